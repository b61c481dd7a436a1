"""Compare logs with a robot, learn what the model lacks, add it, see the error fall."""

from wbc.identification.diagnose import diagnose
from wbc.identification.diagnosis import Diagnosis, ErrorLevel, Estimate, Finding, Step, Verdict

__all__ = ["Diagnosis", "ErrorLevel", "Estimate", "Finding", "Step", "Verdict", "diagnose"]
