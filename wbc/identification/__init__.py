"""Compare logs with a robot, learn what the model lacks, add it, see the error fall."""

from wbc.identification.breakdown import Breakdown
from wbc.identification.compare import compare
from wbc.identification.comparison import Comparison, OutputError, Series
from wbc.identification.contest import Contestant, rank_robots
from wbc.identification.diagnose import diagnose
from wbc.identification.diagnosis import Diagnosis, ErrorLevel, Estimate, Finding, Step, Verdict
from wbc.identification.ranking import Ranked

__all__ = [
    "Breakdown",
    "Comparison",
    "Contestant",
    "Diagnosis",
    "ErrorLevel",
    "Estimate",
    "Finding",
    "OutputError",
    "Ranked",
    "Series",
    "Step",
    "Verdict",
    "compare",
    "diagnose",
    "rank_robots",
]
