"""Measured tosses of a cube, predicted by several simulators from their first free frames."""
