"""What the ingest check says about one log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from wbc.measurement.checks.finding import SEVERITIES, LogFinding


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
