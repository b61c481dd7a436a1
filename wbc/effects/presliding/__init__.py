"""Friction that remembers: bristles that bend before a joint slides."""
