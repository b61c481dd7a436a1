"""Torques that oppose motion, as functions of speed and load."""
