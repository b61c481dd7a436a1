"""Logs: schema, checks, readers and writers, differentiation, repeats."""
