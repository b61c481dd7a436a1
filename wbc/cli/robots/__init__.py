"""The commands on robots alone."""
