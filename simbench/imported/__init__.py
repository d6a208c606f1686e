"""Drives that others recorded: what can be said of a pipeline where nobody knows the truth."""
