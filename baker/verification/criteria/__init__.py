"""Criteria of a verification. Each file detects one kind of fault and implements `criterion.Criterion`."""
