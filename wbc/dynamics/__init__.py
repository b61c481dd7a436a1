"""Evaluated terms, the redundant model, and the dissipative equation of motion."""
