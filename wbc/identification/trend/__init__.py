"""The same machine, day after day: parameters and errors over time, and which machine drifts."""

from wbc.identification.trend.measure import SessionResult
from wbc.identification.trend.runs import Run, find_runs, read_index
from wbc.identification.trend.trend import Drift, Trend, follow

__all__ = ["Drift", "Run", "SessionResult", "Trend", "find_runs", "follow", "read_index"]
