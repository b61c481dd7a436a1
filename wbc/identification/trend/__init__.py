"""Many machines and days: which machine drifts."""

from wbc.identification.trend.sessions import Run, SessionResult, find_runs, read_index
from wbc.identification.trend.trend import Drift, Trend, follow

__all__ = [
    "Drift",
    "Run",
    "SessionResult",
    "Trend",
    "find_runs",
    "follow",
    "read_index",
]
