"""One thing that the ingest check noticed."""

from __future__ import annotations

from dataclasses import dataclass, field

from wbc.measurement.columns.map_table import Mend

SEVERITIES = ("info", "warning", "error")


@dataclass(frozen=True)
class LogFinding:
    """What is odd about a channel, and what to do about it.

    Attributes:
        severity: `error` makes results wrong, `warning` makes them worse, `info` is good to know.
        kind: short name for machines, such as `clock_lag`.
        column: the channel, `time`, or empty for the whole log.
        text: what was seen, with numbers.
        way_out: what to do.
        mend: what a column map says so that the log is right; empty where no map can.
        probability: that it is so.
        guess: what a map would say of the likeliest of several causes that the logs cannot tell
            apart. `wbc init` writes it, marked as a guess; nothing else applies it.
    """

    severity: str
    kind: str
    column: str
    text: str
    way_out: str
    mend: Mend = field(default_factory=dict)
    probability: float = 1.0
    guess: Mend = field(default_factory=dict)

    @property
    def likeliest(self) -> Mend:
        """What a map says if the likeliest cause is the true one."""
        return self.mend or self.guess

    def __str__(self) -> str:
        """Return one line for people."""
        place = f"{self.column}: " if self.column else ""
        return f"{self.severity}: {place}{self.text} {self.way_out}"
