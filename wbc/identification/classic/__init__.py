"""The classic identification of a robot: every parameter at once, by linear least squares."""

from wbc.identification.classic.classic_fit import BaseParameter, ClassicFit, identify

__all__ = ["BaseParameter", "ClassicFit", "identify"]
