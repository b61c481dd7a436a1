"""Masses, springs and gravity of the links."""
