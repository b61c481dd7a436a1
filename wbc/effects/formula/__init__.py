"""Torques given as formulas: the effect, and the grammar of its terms."""
