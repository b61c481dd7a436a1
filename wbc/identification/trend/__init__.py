"""Many machines and days: which machine drifts, and what each one lacks."""

from wbc.identification.trend.fleet import FleetDiagnosis, MachineDiagnosis, diagnose_fleet
from wbc.identification.trend.sessions import Run, SessionResult, find_runs, read_index
from wbc.identification.trend.trend import Drift, Trend, follow

__all__ = [
    "Drift",
    "FleetDiagnosis",
    "MachineDiagnosis",
    "Run",
    "SessionResult",
    "Trend",
    "diagnose_fleet",
    "find_runs",
    "follow",
    "read_index",
]
