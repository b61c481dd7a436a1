"""What a discovery says, for people and for machines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from wbc.effects import CustomTorque
from wbc.identification.answer.diagnosis.diagnosis import ErrorLevel, Estimate
from wbc.robot import Effect, Robot

Outcome = Literal["formula", "partial", "none"]


@dataclass(frozen=True)
class Proposal:
    """A formula for the torque that a model lacks at one joint. A proposal is no cause.

    Attributes:
        effect: the formula, ready to be added to a robot.
        coefficients: value, unit and 90 % interval of each term, by the term's text.
        share: share of the joint's error above the noise floor that the formula removes from logs
            or blocks that neither chose nor fitted it.
        stability: by term, share of the folds that choose it.
        rivals: by term, products that do as well in its place on these logs.
        joints: the joint it acts on first, then those on whose motion it depends.
        warnings: what speaks against believing it.
    """

    effect: CustomTorque
    coefficients: Mapping[str, Estimate]
    share: float
    stability: Mapping[str, float]
    rivals: Mapping[str, tuple[str, ...]]
    joints: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    @property
    def formula(self) -> str:
        """Readable text with units, such as `tau_knee = -0.83 N m * sign(v_knee)`."""
        parts = []
        for name, e in self.coefficients.items():
            size = f"{abs(e.value):.3g} {e.unit}".removesuffix(" 1")
            parts.append(("-" if e.value < 0 else "+", size if name == "1" else f"{size} * {name}"))
        first = ("-" if parts[0][0] == "-" else "") + parts[0][1]
        rest = "".join(f" {sign} {text}" for sign, text in parts[1:])
        return f"tau_{self.effect.where} = {first}{rest}"


@dataclass(frozen=True, eq=False)
class Discovery:
    """Formulas for what the named effects leave unexplained.

    Attributes:
        outcome: `formula` (they explain it), `partial` (they remove a part; memory or a quantity
            outside the library is left) or `none` (no formula found).
        proposals: one per joint with a formula.
        known: named effects that stay beside the formulas, refitted.
        dropped: named effects that no longer pay with the formulas, as (name, place).
        error: held-out error without formulas, with them, and the noise floor.
        remainder: what is left, in words; empty when little is.
        robot: the robot with the named effects that stay and the formulas.
        intervals: (effect, where, parameter) -> (low, high), as `save_robot` takes them.
    """

    outcome: Outcome
    proposals: tuple[Proposal, ...]
    known: tuple[Effect, ...]
    dropped: tuple[tuple[str, str], ...]
    error: ErrorLevel
    remainder: str
    robot: Robot
    intervals: Mapping[tuple[str, str, str], tuple[float, float]]

    @property
    def summary(self) -> str:
        """One sentence that says how far to believe it."""
        if self.outcome == "none":
            return (
                "No formula found: no product of position, speed, acceleration and load explains "
                "what is left on held-out data."
            )
        if self.outcome == "partial":
            return (
                "These formulas remove a part only; the rest has a memory or depends on "
                "something outside the library."
            )
        return "These formulas explain what was left; they are proposals, not causes."

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries."""
        return {
            "outcome": self.outcome,
            "summary": self.summary,
            "proposals": [
                {
                    "joints": list(p.joints),
                    "formula": p.formula,
                    "terms": {
                        name: {
                            "value": e.value,
                            "unit": e.unit,
                            "low": e.low,
                            "high": e.high,
                            "stability": p.stability[name],
                            "rivals": list(p.rivals[name]),
                        }
                        for name, e in p.coefficients.items()
                    },
                    "share_removed": p.share,
                    "warnings": list(p.warnings),
                }
                for p in self.proposals
            ],
            "known": [{"effect": e.name, "where": [e.where]} for e in self.known],
            "dropped": [{"effect": name, "where": [where]} for name, where in self.dropped],
            "error": {
                "before": self.error.before,
                "after": self.error.after,
                "floor": self.error.floor,
                "floor_source": self.error.floor_source,
            },
            "remainder": self.remainder,
        }
