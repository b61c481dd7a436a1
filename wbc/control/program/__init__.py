"""The program of a tick: its rows, its cost, its levels."""
