"""Compare logs with a robot, learn what the model lacks, add it, see the error fall."""

from wbc.identification.answer.breakdown import Breakdown
from wbc.identification.answer.compare import compare
from wbc.identification.answer.comparison import Comparison, OutputError, Series
from wbc.identification.answer.contest import Contestant, rank_robots
from wbc.identification.answer.diagnose import diagnose
from wbc.identification.answer.diagnosis import (
    Diagnosis,
    ErrorLevel,
    Estimate,
    Finding,
    Step,
    Verdict,
)
from wbc.identification.answer.ranking import Ranked

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
