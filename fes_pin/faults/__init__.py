"""Faults of a record: conditions that were misread, noise of recorded efforts."""
