"""Criteria of a verification: one kind of fault a file, all with the interface of `criterion`."""
