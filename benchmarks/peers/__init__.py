"""Controllers to compare with, each run by a Python of its own."""
