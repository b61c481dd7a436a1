"""Solving one step program: every row on its law at once."""
