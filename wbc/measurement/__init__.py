"""Logs: schema, checks, readers and writers, differentiation, repeats."""

from wbc.measurement.log import Log
from wbc.measurement.source import LogSource

__all__ = ["Log", "LogSource"]
