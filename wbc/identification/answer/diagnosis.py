"""What a diagnosis says, for people and for machines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import needs
from wbc.files import as_json
from wbc.identification.answer.shown import (
    Series,
    efforts,
    on_one_screen,
    plain,
    provenance,
    sure,
    with_deviation,
    with_interval,
)
from wbc.identification.answer.words import MEANINGS, verdict_sentence, what_to_do
from wbc.identification.choice.certainty import CERTAIN, EVEN, TIED, Odds, Support
from wbc.identification.choice.evidence import Hypothesis, Key
from wbc.identification.choice.find_causes import RIVALS
from wbc.identification.choice.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.measurement import LogSource
from wbc.robot import Effect, Robot
from wbc.robot.effect import spoken
from wbc.tables import TextTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_ODDS = 6.0  # powers of ten: beyond, odds say nothing that a reader could use
Standing = Literal["found", "better", "worse", "not distinguishable"]
_BLOCKS_PER_PARAMETER = 4  # in fewer blocks parameters are correlated by chance


@dataclass(frozen=True, eq=False)
class Ranked:
    """A hypothesis that was tried, beside the one that was found.

    Attributes:
        added: (effect, where) of what it has and the one found has not.
        removed: (effect, where) of what it lacks.
        error: held-out root mean square in noise floors.
        difference: its held-out mean square minus that of the one found [floors^2].
        deviation: standard error of the difference; both on the same blocks of the logs, a block
            being one observation.
        evidence: its evidence minus that of the one found [nats].
        standing: `found` for what was found itself; `better`, `worse`, or `not distinguishable`,
            by the evidence.
        effects: all it has, with the parameters fitted to these logs.
        covariance: (p, p) of these parameters, in their order and units; None for hypotheses that
            no experiment is planned for: only what was found and its closest rivals have it.
    """

    added: tuple[Key, ...]
    removed: tuple[Key, ...]
    error: float
    difference: float
    deviation: float
    evidence: float
    standing: Standing
    effects: tuple[Effect, ...] = ()
    covariance: FloatArray | None = None

    @property
    def text(self) -> str:
        """What the hypothesis is, in words."""
        if not self.added and not self.removed:
            return "what was found"
        if not self.added:
            return "robot as given" if len(self.removed) > 1 else f"without {_spoken(self.removed)}"
        if not self.removed:
            return f"with {_spoken(self.added)}, too"
        return f"{_spoken(self.added)} instead of {_spoken(self.removed)}"

    @property
    def judgement(self) -> str:
        """What to think of it, in words: how it fits and how probable it is are not the same."""
        if self.standing == "found":
            return "found" if self.effects else "kept"
        if self.standing == "not distinguishable":
            return "as good"
        if self.standing == "better":
            return "more probable"
        # By chance a difference is beyond two standard errors in one of twenty.
        if self.difference < -2.0 * self.deviation:
            return "fits better, but less probable"
        if self.difference > 2.0 * self.deviation:
            return "fits worse"
        return "fits as well, but less probable" if self.removed else "no gain beyond chance"

    @property
    def beyond(self) -> tuple[float, float]:
        """Its error minus that of the one found, and the standard error [noise floors]."""
        both = self.error + np.sqrt(max(self.error**2 - self.difference, 0.0))
        return self.difference / max(both, 1e-300), self.deviation / max(both, 1e-300)

    @property
    def odds(self) -> str:
        """How probable it is beside what was found, such as 1 to 20; empty for that itself."""
        if self.standing == "found":
            return ""
        ratio = 10.0 ** min(abs(self.evidence) / np.log(10.0), _MOST_ODDS)
        whole = 10.0 ** round(float(np.log10(ratio)))
        shown = f"{ratio:.2g}" if ratio < 100.0 else f"{whole:,.0f}"
        more = "beyond " if ratio >= 10.0**_MOST_ODDS else ""
        return more + (f"1 : {shown}" if self.evidence <= 0.0 else f"{shown} : 1")

    def to_json(self) -> dict[str, Any]:
        """Return plain texts and numbers."""
        lists = {"added": self.added, "removed": self.removed}
        keys = {k: [{"effect": n, "where": at} for n, at in own] for k, own in lists.items()}
        return dict(as_json(self)) | keys | {"effects": [effect_entry(e) for e in self.effects]}


def effect_entry(effect: Effect) -> dict[str, Any]:
    """Return an effect as JSON has it."""
    return {"effect": effect.name, "where": effect.where, "parameters": effect.values}


def rank_hypotheses(trials: Trials, odds: Odds, found: Hypothesis) -> tuple[Ranked, ...]:
    """Return the hypotheses that differ from `found` in one cause, most evidence first.

    One cause is an effect less, an effect more, or one in the place of another, at one place or in
    all gears; the robot as given is always among them. What the logs leave open of the parameters
    is told of `found` and of its closest rivals. Those whose links swing behind their gears are
    left out: no experiment is planned for them, and to fit them anew takes long. So are all rivals
    where somebody waits.

    Args:
        trials: which hold the fits, or make them again.
        odds: of everything that was tried.
        found: the hypothesis chosen.
    """
    own, level = set(found.keys), odds.level(found)
    rows, left = [], 0 if trials.hurried else RIVALS
    for h, nats in zip(odds.hypotheses, odds.evidence, strict=True):
        keys = set(h.keys)
        less, more = own - keys, {name for name, _ in keys - own}
        if keys and (len(less) > 1 or len(more) > 1):
            continue
        row, rival = _beside(h, found, nats - level), bool(less and more)
        if keys and not h.swings and (row.standing == "found" or (rival and left > 0)):
            left -= rival
            fit = trials.fit(h, found)
            scales = [parameter.scale for _, parameter in fit.parameters]
            deviations = trials.problem.deviations(fit) * scales
            row = replace(row, covariance=deviations.T @ deviations)
        rows.append(row)
    return tuple(rows)


def _beside(h: Hypothesis, found: Hypothesis, evidence: float) -> Ranked:
    blocks = h.blocks - found.blocks
    own = set(found.keys)
    standing: Standing = "not distinguishable"
    if set(h.keys) == own:
        standing = "found"
    elif abs(evidence) > TIED:
        standing = "better" if evidence > 0.0 else "worse"
    return Ranked(
        added=tuple(key for key in h.keys if key not in own),
        removed=tuple(key for key in found.keys if key not in h.keys),
        error=float(np.sqrt(h.error)),
        difference=h.error - found.error,
        deviation=float(np.std(blocks, ddof=1) / np.sqrt(blocks.size)),
        evidence=evidence,
        standing=standing,
        effects=h.effects,
    )


def _spoken(keys: tuple[Key, ...]) -> str:
    return " and ".join(f"{spoken(name)} at {where}" for name, where in keys)


@dataclass(frozen=True, eq=False)
class Correlation:
    """Correlations of the parameters found, over blocks of the logs.

    Attributes:
        names: (effect, where, parameter) of each.
        matrix: (p, p), ones on the diagonal; zero beside a parameter that no block moves. Empty
            where there are too few blocks to tell.
    """

    names: tuple[tuple[str, str, str], ...]
    matrix: FloatArray


def correlation_of(problem: EstimationProblem, fit: Fit) -> Correlation:
    """Return how the parameters of a fit move together."""
    names = tuple((*fit.effects[k].key, parameter.name) for k, parameter in fit.parameters)
    count = len(names)
    if count < 2 or np.unique(problem.blocks).size < _BLOCKS_PER_PARAMETER * count:
        return Correlation(names, np.zeros((0, 0)))
    deviations = problem.deviations(fit)
    size = np.linalg.norm(deviations, axis=0)
    moving = size > 0.0
    own = deviations[:, moving] / size[moving]
    matrix = np.eye(count)
    matrix[np.ix_(moving, moving)] = own.T @ own
    return Correlation(names, matrix)


_RANKED = 5  # rows of a ranking where not all of it is wanted

Verdict = Literal["none", "named", "ambiguous", "partial", "unknown", "not_repeatable"]


@dataclass(frozen=True)
class Estimate:
    """A number that was found: value with the ends of its 90 % interval, in `unit`.

    `given` is what the robot as given has in its place, None where it has nothing of the kind.
    `used` is what the model to use has in its place where that lies outside the interval: there a
    doubtful cause does a part of the work.
    """

    value: float
    unit: str
    low: float
    high: float
    given: float | None = None
    used: float | None = None

    @property
    def cells(self) -> tuple[str, str, str]:
        """Value, interval and unit as a table has them: the unit of a ratio is not written."""
        unit = "" if self.unit == "1" else self.unit
        return (*with_interval(self.value, self.low, self.high), unit)


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
        effect: the effect with its parameters, of the hypothesis in which it is believed.
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
        if self.quantities or self.effect.search.departures(self.effect).size:
            return self.quantities
        ends = {p.name: (p.low, p.high) for p in self.effect.parameters}
        return {k: e for k, e in self.parameters.items() if (e.low, e.high) != ends.get(k)}

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


@dataclass(frozen=True, eq=False)
class Diagnosis:
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

    def effect_rows(self) -> TextTable:
        """Return the effects found, the doubtful last, each kind of them in one line."""
        doubtful = [f for f in self.findings if f.doubtful]
        cells = [row for f in self.findings if not f.doubtful for row in _finding_cells(f)]
        for name in dict.fromkeys(f.effect.name for f in doubtful):
            cells.append(_doubtful_cells([f for f in doubtful if f.effect.name == name]))
        return TextTable.of("~effect at place|>value|90 % interval|unit|is it there?", cells)

    def left_rows(self) -> TextTable:
        """Return what is left at each output; "after" only where something was found."""
        found, cells = bool(self.findings), []
        for o in self.outputs:
            numbers = (o.before, *((o.after,) if found else ()), o.attainable, o.floor)
            told_unit = o.unit if o.judged else f"{o.unit}, set aside"
            cells.append((o.output, *(plain(x, 2) for x in numbers), told_unit))
        reported = efforts(o.unit for o in self.outputs)
        return TextTable.of(
            f"left at|>before|{'>after|' if found else ''}>attainable|>noise floor|",
            cells,
            caption=f"rms {reported} that the model does not explain; attainable: what the best "
            "model of the motion would leave; noise floor: what noise leaves",
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
            (row.text, plain(row.error, 2), with_deviation(*row.beyond), row.judgement)
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

    def __str__(self) -> str:
        """Return the answer as text: a sentence, the causes, what is left per joint, what to do."""
        tables = (self.effect_rows(), self.left_rows())
        return "\n".join(
            [
                f"verdict: {self.verdict} ({MEANINGS[self.verdict]})",
                verdict_sentence(self),
                *(str(table) for table in tables if table.cells),
                f"do this now: {what_to_do(self)}",
                *self.warnings,
            ]
        )

    def __repr__(self) -> str:
        """Return what `print` shows, cut to one screen."""
        return on_one_screen(str(self))

    def _repr_html_(self) -> str:
        """Return the answer as a notebook shows it."""
        tables = (self.effect_rows(), self.left_rows())
        return (
            f"<p><b>{escape(verdict_sentence(self))}</b></p>"
            f"<p style='white-space: pre-wrap'>Do this now: {escape(what_to_do(self))}</p>"
            + "".join(table.html() for table in tables if table.cells)
        )

    def plot(self, log: int = 0) -> Figure:
        """Return torques of one log over time, measured and of both models, with the residuals.

        Args:
            log: number of the log.

        Raises:
            MissingPackageError: matplotlib is not installed.
        """
        units = {o.output: o.unit for o in self.outputs[: self.robot.transmission.size]}
        models = [("as given", self.before), ("with the effects found", self.after)]
        with needs("view", "plot()"):
            from wbc.identification.answer.figure import torque_figure
        return torque_figure(units, models, log)

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects found; `robot` has those of the model to use, with the numbers it uses."""
        return tuple(finding.effect for finding in self.findings)

    def intervals(self) -> dict[tuple[str, str, str], tuple[float, float]]:
        """Return (effect, where, parameter) -> (low, high), as `save_robot` takes them.

        They hold what the model to use has, too.
        """
        ends = {}
        for f in self.findings:
            for name, e in f.parameters.items():
                span = (e.low, e.high, e.low if e.used is None else e.used)
                ends[f.effect.name, f.effect.where, name] = (min(span), max(span))
        return ends

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries with the keys of the log format."""
        rivals: dict[str, dict[str, None]] = {}
        for f in self.findings:
            rivals.setdefault(f.effect.name, {}).update(dict.fromkeys(f.rivals))
        told = {
            "verdict": self.verdict,
            "effects": [
                {
                    "effect": f.effect.name,
                    "where": [f.effect.where],
                    "parameters": f.parameters,
                    "quantities": f.quantities,
                    "probability": f.probability,
                    "support": f.support,
                    "alternatives": f.alternatives,
                    "explanation": f.effect.explanation,
                    "warnings": f.warnings,
                }
                for f in self.findings
            ],
            "alternatives": {name: list(others) for name, others in rivals.items()},
            "next_experiment": self.next_experiment,
            "band": self.band,
            "error": self.error,
            "explained": self.explained,
            "joints": {o.output: o for o in self.outputs},
            "steps": self.steps,
            "remainder": self.remainder,
            "trait": self.trait,
            "warnings": self.warnings,
            "ranking": [row.to_json() for row in self.ranking],
            "correlation": {
                "parameters": self.correlation.names,
                "matrix": self.correlation.matrix,
            },
            "provenance": provenance(self.sources),
        }
        return dict(as_json(told))


def _finding_cells(finding: Finding) -> list[tuple[str, ...]]:
    """Return the lines of an effect in a table: one where it has a single number."""
    name, numbers = f"{finding.effect.name} at {finding.effect.where}", finding.numbers
    certainty, alone = sure(finding.probability), len(numbers) == 1
    cells: list[tuple[str, ...]] = [] if alone else [(name, "", "", "", certainty)]
    indent = "  " if alone else "    "
    for number, e in numbers.items():
        first, last = (name, certainty) if alone else (f"  {number}", "")
        cells.append((first, *e.cells, last))
        beside = {"as given": e.given, "in the model to use": e.used}
        cells += [(indent + k, plain(v)) for k, v in beside.items() if v is not None]
    if finding.alternatives:
        one = sure(finding.support.group_probability)
        cells.append(("  or " + ", or ".join(finding.rivals), "", "", "", f"{one} of one"))
    return [*cells, *((f"  warning: {warning}",) for warning in finding.warnings)]


def _doubtful_cells(alike: Sequence[Finding]) -> tuple[str, ...]:
    """Return the line of a doubtful effect at its places; with its number if it has only one."""
    first = alike[0]
    place = first.effect.where if len(alike) == 1 else f"{len(alike)} places"
    numbers = [e.cells for finding in alike for e in finding.numbers.values()]
    value, unit = (numbers[0][0], numbers[0][2]) if len(numbers) == 1 else ("", "")
    return (f"{first.effect.name} at {place}", value, "", unit, "doubtful")
