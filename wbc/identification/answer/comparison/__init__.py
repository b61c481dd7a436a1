"""How far robots are from their logs, and where."""
