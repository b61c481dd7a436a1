"""What the columns of logs hold, told by a robot: checks, mistakes, and what the torque is."""

from wbc.identification.readings.checks import (
    LogQuality as LogQuality,
    check_log as check_log,
    check_logs as check_logs,
    check_robot as check_robot,
)
from wbc.identification.readings.mistakes import (
    SuspiciousLogError as SuspiciousLogError,
    find_suspicions as find_suspicions,
    suspicions as suspicions,
)
from wbc.identification.records.channels import with_machine as with_machine
from wbc.measurement.checks import find_repeats as find_repeats
