"""Compare logs with a robot, learn what the model lacks, add it, see the error fall."""

from wbc.identification.answer.comparison import (
    Comparison,
    Contestant,
    OutputError,
    compare,
    rank_robots,
)
from wbc.identification.answer.diagnose import diagnose
from wbc.identification.answer.diagnosis import (
    Alternative,
    Diagnosis,
    ErrorLevel,
    Estimate,
    Finding,
    OutputLevel,
    Ranked,
    Step,
    Verdict,
)
from wbc.identification.answer.remainder import Breakdown
from wbc.identification.answer.shown import Series
from wbc.identification.choice.certainty import Support
from wbc.identification.open_loop import OpenLoop, open_loop

__all__ = [
    "Alternative",
    "Breakdown",
    "Comparison",
    "Contestant",
    "Diagnosis",
    "ErrorLevel",
    "Estimate",
    "Finding",
    "OpenLoop",
    "OutputError",
    "OutputLevel",
    "Ranked",
    "Series",
    "Step",
    "Support",
    "Verdict",
    "compare",
    "diagnose",
    "open_loop",
    "rank_robots",
]
