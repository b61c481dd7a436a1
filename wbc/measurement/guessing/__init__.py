"""First guesses about a stranger's files: a column map and a robot description to correct."""
