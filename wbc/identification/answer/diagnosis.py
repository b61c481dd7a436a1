"""What a diagnosis says, for people and for machines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from wbc.identification.answer.ranking import Ranked
from wbc.identification.answer.sentence import verdict_sentence, what_to_do
from wbc.identification.choice.certainty import Support
from wbc.robot import Effect, Robot

Verdict = Literal["none", "named", "ambiguous", "partial", "unknown", "not_repeatable"]


@dataclass(frozen=True)
class Estimate:
    """A number that was found: value with the ends of its 90 % interval, in `unit`.

    `drawn` is what the robot as given has in its place; None for a parameter of an effect.
    """

    value: float
    unit: str
    low: float
    high: float
    drawn: float | None = None


@dataclass(frozen=True)
class Alternative:
    """An effect at a place that could stand for another one on these logs."""

    effect: str
    where: str

    def beside(self, name: str) -> str:
        """Return its name; with its place if it is the same effect elsewhere."""
        return f"{self.effect} at {self.where}" if self.effect == name else self.effect


@dataclass(frozen=True)
class Finding:
    """One effect that the logs show.

    Attributes:
        effect: the effect with its fitted parameters.
        parameters: estimates by parameter name.
        support: what speaks for it.
        alternatives: the effects it cannot be told from on these logs.
        warnings: at a bound, not identifiable.
        quantities: what a person can check, by name, where the parameters are not it and logs tell
            that it differs from the robot as given.
    """

    effect: Effect
    parameters: Mapping[str, Estimate]
    support: Support
    alternatives: tuple[Alternative, ...] = ()
    warnings: tuple[str, ...] = ()
    quantities: Mapping[str, Estimate] = field(default_factory=dict)

    @property
    def numbers(self) -> Mapping[str, Estimate]:
        """What a person reads: the quantities, or else the parameters."""
        return self.quantities or self.parameters

    @property
    def probability(self) -> float:
        """That the effect is there."""
        return self.support.probability

    @property
    def rivals(self) -> tuple[str, ...]:
        """Names of the alternatives, each once; `name at place` for the same effect elsewhere."""
        return tuple(dict.fromkeys(a.beside(self.effect.name) for a in self.alternatives))


@dataclass(frozen=True)
class ErrorLevel:
    """Root mean square errors on held-out data, in units of the noise floor.

    Attributes:
        before: of the robot that was given.
        after: of the robot with the effects found.
        floor: 1 by definition.
        floor_source: `repeats` or `lower bound`.
    """

    before: float
    after: float
    floor: float
    floor_source: str


@dataclass(frozen=True)
class OutputLevel:
    """What is left at one output, root mean square on the logs, in its unit.

    Attributes:
        output: joint (torque at the motor output) or undriven coordinate (wrench).
        unit: of the numbers.
        before: of the robot that was given.
        after: of the robot with the effects found.
        attainable: what any model of motion, load and time would leave.
        sensors: what the noise of the sensors leaves.
    """

    output: str
    unit: str
    before: float
    after: float
    attainable: float
    sensors: float


@dataclass(frozen=True)
class Step:
    """Held-out error after an addition (the first step adds nothing)."""

    added: str
    where: str
    error: float


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What is missing from a robot, as far as its logs can tell.

    Attributes:
        verdict: `none` (nothing is missing), `named`, `ambiguous` (several effects explain the
            same), `unknown` (something is missing that no candidate explains) or
            `not_repeatable` (repeated runs disagree with one another).
        findings: the effects, in the order added.
        next_experiment: what to record next.
        error: before, after and floor.
        outputs: what is left at each joint and undriven coordinate.
        explained: share of the mean square error that the effects found take away.
        steps: error after each addition.
        remainder: what an unexplained remainder looks like; empty when there is none.
        robot: the robot with the effects found.
        warnings: about the logs.
        ranking: the models tried that differ from the one found in one effect, best first.
    """

    verdict: Verdict
    findings: tuple[Finding, ...]
    next_experiment: str
    error: ErrorLevel
    outputs: tuple[OutputLevel, ...]
    explained: float
    steps: tuple[Step, ...]
    remainder: str
    robot: Robot
    warnings: tuple[str, ...] = ()
    ranking: tuple[Ranked, ...] = ()

    def __str__(self) -> str:
        """Return the answer as text: a sentence, the causes, what is left per joint, what to do."""
        lines = [f"{self.verdict}: {verdict_sentence(self)}"]
        for finding in self.findings:
            numbers = ", ".join(
                f"{name} {e.value:.4g} ({e.low:.4g} to {e.high:.4g}) {e.unit}".removesuffix(" 1")
                + (f" (drawn {e.drawn:.4g})" if e.drawn is not None else "")
                for name, e in finding.numbers.items()
            )
            rivals = f", or {', or '.join(finding.rivals)}" if finding.alternatives else ""
            lines.append(
                f"  {finding.effect.name} at {finding.effect.where}{rivals}: {numbers}; "
                f"probability {finding.probability:.2f}"
            )
        lines += [
            f"  {o.output}: {o.before:.3g} -> {o.after:.3g} {o.unit} "
            f"(attainable {o.attainable:.3g}, sensors {o.sensors:.3g})"
            for o in self.outputs
        ]
        return "\n".join([*lines, f"do this now: {what_to_do(self)}", *self.warnings])

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects found, with fitted parameters."""
        return tuple(finding.effect for finding in self.findings)

    def intervals(self) -> dict[tuple[str, str, str], tuple[float, float]]:
        """Return (effect, where, parameter) -> (low, high), as `save_robot` takes them."""
        return {
            (f.effect.name, f.effect.where, name): (estimate.low, estimate.high)
            for f in self.findings
            for name, estimate in f.parameters.items()
        }

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries with the keys of the log format."""
        return {
            "verdict": self.verdict,
            "effects": [
                {
                    "effect": f.effect.name,
                    "where": [f.effect.where],
                    "parameters": {
                        name: {"value": e.value, "unit": e.unit, "low": e.low, "high": e.high}
                        for name, e in f.parameters.items()
                    },
                    "quantities": {
                        name: {
                            "value": e.value,
                            "unit": e.unit,
                            "low": e.low,
                            "high": e.high,
                            "drawn": e.drawn,
                        }
                        for name, e in f.quantities.items()
                    },
                    "probability": f.probability,
                    "support": asdict(f.support),
                    "alternatives": [
                        {"effect": a.effect, "where": a.where} for a in f.alternatives
                    ],
                    "explanation": f.effect.explanation,
                    "warnings": list(f.warnings),
                }
                for f in self.findings
            ],
            "alternatives": {f.effect.name: [] for f in self.findings}
            | self._alternatives_by_name(),
            "next_experiment": self.next_experiment,
            "error": {
                "before": self.error.before,
                "after": self.error.after,
                "floor": self.error.floor,
                "floor_source": self.error.floor_source,
            },
            "explained": self.explained,
            "joints": {
                o.output: {
                    "unit": o.unit,
                    "before": o.before,
                    "after": o.after,
                    "attainable": o.attainable,
                    "sensors": o.sensors,
                }
                for o in self.outputs
            },
            "steps": [{"added": s.added, "where": s.where, "error": s.error} for s in self.steps],
            "remainder": self.remainder,
            "warnings": list(self.warnings),
            "ranking": [row.to_json() for row in self.ranking],
        }

    def _alternatives_by_name(self) -> dict[str, list[str]]:
        merged: dict[str, list[str]] = {}
        for finding in self.findings:
            names = merged.setdefault(finding.effect.name, [])
            names.extend(name for name in finding.rivals if name not in names)
        return merged
