"""Sensors that report something else than what is true."""
