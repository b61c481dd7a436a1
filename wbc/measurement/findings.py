"""What the checks of logs say: single findings, and the quality of a log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from wbc.measurement.map_lines import Mend

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


@dataclass(frozen=True)
class LogQuality:
    """Clock, resolution and findings of one log.

    Attributes:
        label: how messages call the log.
        rows: N.
        duration: [s].
        rate: 1 / median distance of the time stamps [Hz].
        jitter: standard deviation of the distances over their median.
        longest_gap: largest distance of two time stamps [s].
        velocity_delay: joint -> delay of the velocity behind the position [s].
        velocity_scale: joint -> velocity / (d position / d time).
        resolution: channel -> quantisation step, in its unit; 0 where none shows.
        findings: in order of severity, gravest first.
    """

    label: str
    rows: int
    duration: float
    rate: float
    jitter: float
    longest_gap: float
    velocity_delay: Mapping[str, float]
    velocity_scale: Mapping[str, float]
    resolution: Mapping[str, float]
    findings: tuple[LogFinding, ...]

    @property
    def usable(self) -> bool:
        """Whether nothing was found that makes results wrong."""
        return all(finding.severity != "error" for finding in self.findings)

    def of_kind(self, kind: str) -> tuple[LogFinding, ...]:
        """Return the findings of one kind."""
        return tuple(finding for finding in self.findings if finding.kind == kind)

    def __str__(self) -> str:
        """Return a few lines for people."""
        head = (
            f"{self.label}: {self.rows} rows, {self.duration:.3f} s, {self.rate:.1f} Hz, jitter "
            f"{100.0 * self.jitter:.1f} %, longest gap {1e3 * self.longest_gap:.1f} ms"
        )
        return "\n".join([head, *(f"  {finding}" for finding in self.findings)])


def by_severity(findings: list[LogFinding]) -> tuple[LogFinding, ...]:
    """Return findings with the gravest first, otherwise in the order given."""
    return tuple(sorted(findings, key=lambda finding: -SEVERITIES.index(finding.severity)))
