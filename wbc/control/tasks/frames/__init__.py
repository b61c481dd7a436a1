"""Tasks on frames."""
