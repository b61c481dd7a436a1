"""Runnable studies on the public API: `python -m sims.NAME`."""
