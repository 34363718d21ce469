"""Criteria of a verification. Each file detects one kind of fault, with the interface of `criterion`."""
