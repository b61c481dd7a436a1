"""Compare logs with a robot, learn what the model lacks, add it, see the error fall."""

from wbc.identification.answer.comparison.breakdown import Breakdown
from wbc.identification.answer.comparison.compare import compare
from wbc.identification.answer.comparison.comparison import Comparison, OutputError
from wbc.identification.answer.comparison.contest import Contestant, rank_robots
from wbc.identification.answer.diagnosis.diagnose import diagnose
from wbc.identification.answer.diagnosis.diagnosis import (
    Alternative,
    Diagnosis,
    ErrorLevel,
    Estimate,
    Finding,
    OutputLevel,
    Step,
    Verdict,
)
from wbc.identification.answer.diagnosis.ranking import Ranked
from wbc.identification.answer.series import Series
from wbc.identification.choice.weighing.certainty import Support

__all__ = [
    "Alternative",
    "Breakdown",
    "Comparison",
    "Contestant",
    "Diagnosis",
    "ErrorLevel",
    "Estimate",
    "Finding",
    "OutputError",
    "OutputLevel",
    "Ranked",
    "Series",
    "Step",
    "Support",
    "Verdict",
    "compare",
    "diagnose",
    "rank_robots",
]
