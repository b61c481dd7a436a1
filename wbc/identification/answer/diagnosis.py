"""What a diagnosis says, for people and for machines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from wbc.files import as_json
from wbc.identification.answer import shown
from wbc.identification.answer.ranking import Correlation, Ranked
from wbc.identification.answer.shown import Series, Shown, plain
from wbc.identification.answer.words import VERDICTS, verdict_sentence, what_to_do
from wbc.identification.choice.certainty import CERTAIN, EVEN, Support
from wbc.measurement import LogSource
from wbc.robot import Effect, Robot
from wbc.tables import TextTable

_RANKED = 5  # rows of a ranking where not all of it is wanted

_UNTOLD = ("findings", "outputs", "robot", "before", "after", "sources", "silent")  # in JSON
Verdict = Literal["none", "named", "ambiguous", "partial", "unknown", "not_repeatable"]


@dataclass(frozen=True)
class Estimate:
    """A number that was found: value with the ends of its 90 % interval, in `unit`.

    It is that without doubtful causes; the interval holds the number of the model to use, too.

    `given` is what the robot as given has in its place, None where it has nothing of the kind.
    """

    value: float
    unit: str
    low: float
    high: float
    given: float | None = None

    @property
    def cells(self) -> tuple[str, str, str]:
        """Value, interval and unit as a table has them: the unit of a ratio is not written."""
        unit = "" if self.unit == "1" else self.unit
        return (*shown.with_interval(self.value, self.low, self.high), unit)


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
        effect: the effect with its parameters, without doubtful causes.
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
        """What a person reads: the quantities of what is drawn, or else the parameters told.

        A parameter whose interval is its whole range is not told: the warnings name it.
        """
        if self.quantities or self.effect.search.drawn:
            return self.quantities
        ends = {p.name: (p.low, p.high) for p in self.effect.parameters}
        return {k: e for k, e in self.parameters.items() if (e.low, e.high) != ends.get(k)}

    def to_json(self) -> dict[str, Any]:
        """Return what JSON has of it."""
        told = ("parameters", "quantities", "probability", "support", "alternatives", "warnings")
        own = {"effect": self.effect.name, "where": [self.effect.where]}
        own |= {"explanation": self.effect.explanation}
        return own | {name: getattr(self, name) for name in told}

    @property
    def probability(self) -> float:
        """That the effect is there."""
        return self.support.probability

    @property
    def certain(self) -> bool:
        """Whether it is, alone or with what it cannot be told from."""
        return self.support.group_probability >= CERTAIN

    @property
    def doubtful(self) -> bool:
        """Whether it stands in the model for its torque, whatever its name."""
        return self.support.group_probability < EVEN

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
        attainable: what the best model of motion, load and time would leave; below `floor` only
            where what was found is.
        floor: the noise floor, what noise alone leaves.
        judged: False where the drive reports next to nothing and the output was set aside.
        excess: how many times the noise floor is what the noise of the sensors explains; above 1
            where repeated runs differ by more than that.
    """

    output: str
    unit: str
    before: float
    after: float
    attainable: float
    floor: float
    judged: bool = True
    excess: float = 1.0


@dataclass(frozen=True)
class Step:
    """Held-out error after an addition (the first step adds nothing).

    Attributes:
        added: name of the effect.
        where: its place, its places, or how many there are.
        error: with it and all before it [noise floors].
    """

    added: str
    where: str
    error: float


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Shown):
    """What is missing from a robot, as far as its logs can tell.

    Attributes:
        verdict: `none` (nothing is missing), `named`, `ambiguous` (what is likely is not
            certain, or other effects explain the same), `unknown` (something is missing that no
            candidate explains) or
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
        correlation: which of the parameters move together.
        before: measured torques and those of the robot as given over time, one per log.
        after: the same with the effects found.
        sources: where the logs came from.
        band: [Hz] that was read of torques; NaN where it is not known.
        silent: joints whose drives report no torque of the motion; set aside unless no other drive
            reports.
        trait: what several doubtful causes add together, in words; empty without several.
        stopped: why the search ended early, in words; empty where it did not.
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
    correlation: Correlation = field(default=Correlation((), np.zeros((0, 0))))
    before: tuple[Series, ...] = ()
    after: tuple[Series, ...] = ()
    sources: tuple[LogSource, ...] = ()
    silent: tuple[str, ...] = ()
    band: float = np.nan
    trait: str = ""
    stopped: str = ""

    def effect_rows(self) -> TextTable:
        """Return the effects found, the doubtful last, each kind of them in one line."""
        doubtful = [f for f in self.findings if f.doubtful]
        cells = [row for f in self.findings if not f.doubtful for row in _finding_cells(f)]
        for name in dict.fromkeys(f.effect.name for f in doubtful):
            alike = [f for f in doubtful if f.effect.name == name]
            place = alike[0].effect.where if len(alike) == 1 else f"{len(alike)} places"
            numbers = [e.cells for f in alike for e in f.numbers.values()]
            value, _, unit = numbers[0] if len(numbers) == 1 else ("", "", "")
            cells.append((f"{name} at {place}", value, "", unit, "doubtful"))
        return TextTable.of("effect at place|>value|90 % interval|unit|is it there?", cells)

    def left_rows(self) -> TextTable:
        """Return what is left at each output; "after" only where something was found."""
        found, cells = bool(self.findings), []
        for o in self.outputs:
            numbers = (o.before, *((o.after,) if found else ()), o.attainable, o.floor)
            told_unit = o.unit if o.judged else f"{o.unit}, set aside"
            cells.append((o.output, *(plain(x, 2) for x in numbers), told_unit))
        return TextTable.of(
            f"left at|>before|{'>after|' if found else ''}>attainable|>noise floor|",
            cells,
            caption=f"rms {shown.efforts(o.unit for o in self.outputs)} that the model does not "
            "explain; attainable: what the best model of the motion would leave; noise floor: what "
            "noise leaves",
        )

    def step_rows(self) -> TextTable:
        """Return how the error falls with each effect that is added."""
        return TextTable.of(
            "added|where|>held-out error",
            ((s.added or "(the model as given)", s.where, plain(s.error, 2)) for s in self.steps),
            caption=f"in noise floors (floor from {self.error.floor_source})",
        )

    def ranking_rows(self, whole: bool) -> TextTable:
        """Return the models tried, with what they leave beyond the one found."""
        tried = [row for row in self.ranking if row.standing != "found"]
        cells: list[tuple[str, ...]] = [
            (row.text, plain(row.error, 2), shown.with_deviation(*row.beyond), row.judgement)
            for row in (tried if whole else tried[:_RANKED])
        ]
        if len(tried) > _RANKED and not whole:
            cells.append((f"and {len(tried) - _RANKED} more (--verbose)",))
        return TextTable.of(
            "what else was tried|>error|>beyond it|",
            cells,
            caption="most probable first; error: held out, in noise floors; beyond it: minus the "
            "error of what was found, ± standard error; `wbc list effects` explains the names",
        )

    @property
    def sentence(self) -> str:
        """The verdict, and what it says of the model."""
        return f"{self.headline}\n{verdict_sentence(self)}"

    @property
    def headline(self) -> str:
        """The verdict and its meaning."""
        return f"verdict: {self.verdict} ({VERDICTS[self.verdict][1]})"

    @property
    def to_do(self) -> str:
        """What to do now, in Python."""
        return what_to_do(self)

    def tables(self) -> tuple[TextTable, ...]:
        """Return the causes, and what is left per joint."""
        return self.effect_rows(), self.left_rows()

    def models(self) -> list[tuple[str, Sequence[Series]]]:
        """Return the torques of both models."""
        return [("as given", self.before), ("with the effects found", self.after)]

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects found; `robot` has those of the model to use, with the numbers it uses."""
        return tuple(finding.effect for finding in self.findings)

    def intervals(self) -> dict[tuple[str, str, str], tuple[float, float]]:
        """Return (effect, where, parameter) -> (low, high), as `save_robot` takes them."""
        return {
            (f.effect.name, f.effect.where, name): (e.low, e.high)
            for f in self.findings
            for name, e in f.parameters.items()
        }

    def to_json(self, command: str = "") -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries with the keys of the log format.

        Args:
            command: how to run it again.
        """
        rivals: dict[str, dict[str, None]] = {}
        for f in self.findings:
            rivals.setdefault(f.effect.name, {}).update(dict.fromkeys(f.rivals))
        told = {name: own for name, own in vars(self).items() if name not in _UNTOLD} | {
            "effects": [f.to_json() for f in self.findings],
            "alternatives": {name: list(others) for name, others in rivals.items()},
            "joints": {o.output: o for o in self.outputs},
            "ranking": [row.to_json() for row in self.ranking],
            "provenance": shown.provenance(self.sources, command),
        }
        return dict(as_json(told))


def _finding_cells(finding: Finding) -> list[tuple[str, ...]]:
    """Return the lines of an effect in a table: one where it has a single number."""
    name, numbers = f"{finding.effect.name} at {finding.effect.where}", finding.numbers
    certainty, alone = shown.sure(finding.probability), len(numbers) == 1
    cells: list[tuple[str, ...]] = [] if alone else [(name, "", "", "", certainty)]
    indent = "  " if alone else "    "
    for number, e in numbers.items():
        first, last = (name, certainty) if alone else (f"  {number}", "")
        cells.append((first, *e.cells, last))
        cells += [] if e.given is None else [(f"{indent}as given", plain(e.given))]
    if finding.alternatives:
        one = shown.sure(finding.support.group_probability)
        cells.append(("  or " + ", or ".join(finding.rivals), "", "", "", f"{one} of one"))
    return [*cells, *((f"  warning: {warning}",) for warning in finding.warnings)]
