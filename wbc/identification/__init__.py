"""Compare logs with a robot, learn what the model lacks, add it, see the error fall."""

from wbc.identification.answer.comparison import (
    Comparison as Comparison,
    Contestant as Contestant,
    OutputError as OutputError,
    compare as compare,
    rank_robots as rank_robots,
)
from wbc.identification.answer.diagnose import diagnose as diagnose
from wbc.identification.answer.diagnosis import (
    Alternative as Alternative,
    Diagnosis as Diagnosis,
    ErrorLevel as ErrorLevel,
    Estimate as Estimate,
    Finding as Finding,
    OutputLevel as OutputLevel,
    Step as Step,
    Verdict as Verdict,
)
from wbc.identification.answer.ranking import Ranked as Ranked
from wbc.identification.answer.remainder import Breakdown as Breakdown
from wbc.identification.answer.shown import Series as Series
from wbc.identification.choice.certainty import Support as Support
from wbc.identification.open_loop import OpenLoop as OpenLoop, open_loop as open_loop
