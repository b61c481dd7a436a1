"""Filters and derivatives of motion, and how a measured velocity relates to its position."""
