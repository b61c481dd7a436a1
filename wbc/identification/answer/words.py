"""What a diagnosis says, as a person would, and what to do after it."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from wbc.identification.answer.shown import plain
from wbc.robot.effect import spoken
from wbc.tables import FEW, joined

if TYPE_CHECKING:
    from wbc.identification.answer.diagnosis import Diagnosis, Finding, OutputLevel

VERDICTS = {
    "named": ("cause found", "these logs tell which effects the model lacks"),
    "ambiguous": (
        "likely, not certain",
        "what these logs point to is likely, but its name is not certain",
    ),
    "partial": ("part of the cause found", "some missing effects are certain, and more is missing"),
    "unknown": ("cause not found", "most of what is missing has no certain explanation"),
    "none": ("nothing missing", "the model explains these logs as far as their noise allows"),
    "not_repeatable": ("runs disagree", "repeated runs disagree, so nothing can be named"),
}
"""A verdict -> its title, in words that need no explanation, and what it means."""
COMMAND = "    "
"""Begins every line of advice that is a command to copy."""
_USE = "Use the corrected model."
_RECORD = "Change neither the robot nor its model yet."
_DOUBTED = (
    "Use the corrected model: it predicts best (but do not change the robot because of a doubtful "
    "name)."
)
_SAVED = "fitted.toml"
_NEW_LOG = "new.csv"
_NEW_RUNS = ("new1.csv", "new2.csv")


def verdict_sentence(diagnosis: Diagnosis) -> str:
    """Return what is certain, what is likely, how good the model is, what is left and doubtful."""
    return f"{cut_short(diagnosis.stopped)} {_sentence(diagnosis)}".lstrip()


def cut_short(why: str) -> str:
    """Return that a search ended early, and why; empty where it did not."""
    said = f"The search did not end by itself ({why}): this is the best answer so far."
    return said if why else ""


def _sentence(diagnosis: Diagnosis) -> str:
    silent, judged = not_following(diagnosis.silent), _judged(diagnosis)
    worst = max(judged, key=lambda o: o.after / _noise(o))
    left = f"{plain(worst.after, 2)} {worst.unit} are left at {worst.output}"
    if diagnosis.verdict == "none":
        nothing = (
            "Nothing is missing in the model: it explains these logs as far as their noise "
            f"lets it ({left}, {plain(diagnosis.error.after, 2)} noise floors)."
        )
        return f"{nothing} {_doubt(diagnosis)}".rstrip()
    if diagnosis.verdict == "not_repeatable":
        worst = max(judged, key=lambda o: o.excess)
        times = f"{plain(worst.excess, 2)} times what the noise of their sensors explains"
        return (
            f"Runs that repeat one another disagree: by {plain(worst.floor, 2)} {worst.unit} at "
            f"{worst.output}, {times}. So nothing can be named from these logs."
        )
    if silent and {o.output for o in judged} <= set(diagnosis.silent):
        return f"These logs cannot tell what is missing: {silent[0].lower()}{silent[1:]}."
    if not diagnosis.findings:
        said = [f"Something is missing that no known effect explains ({left})."]
    else:
        said = [*_names(diagnosis), _progress(diagnosis)]
        if diagnosis.remainder:
            said.append(f"No known effect explains the rest: {left}.")
        elif diagnosis.verdict == "partial":
            said.append("One cause that is in no list may stand behind several of these.")
        said.append(_doubt(diagnosis))
    return " ".join([*filter(None, said), *([f"{silent}."] if silent else [])])


def _names(diagnosis: Diagnosis) -> list[str]:
    """Say which causes are certain, and which are likely."""
    certain = [f for f in diagnosis.findings if f.certain]
    likely = [f for f in diagnosis.findings if not (f.certain or f.doubtful)]
    if diagnosis.verdict == "ambiguous":
        found = _sum_up([*certain, *likely])
        tied = [f for f in diagnosis.findings if f.alternatives]
        pairs = ((spoken(f.effect.name), joined([spoken(a) for a in f.rivals])) for f in tied)
        rivals = "; ".join(dict.fromkeys(f"{one} from {others}" for one, others in pairs))
        if not rivals:
            return [f"Likely missing in the model: {found}."]
        return [f"It would be enough to add {found}.", f"But these logs cannot tell {rivals}."]
    if certain:
        own = [e for f in certain if not f.quantities for e in f.numbers.values()]
        what = "missing or different" if any(e.given is not None for e in own) else "missing"
        what = what if diagnosis.verdict == "named" else f"certainly {what}"
        said = [f"{what[0].upper()}{what[1:]} in the model: {_sum_up(certain)}."]
    else:
        said = ["Something is missing in the model, and no cause of it is certain."]
    return [*said, *([f"Likely: {_sum_up(likely)}."] if likely else [])]


def _doubt(diagnosis: Diagnosis) -> str:
    """Say which causes are in the model for their torque, whatever their name; empty for none."""
    places = Counter(f.effect.name for f in diagnosis.findings if f.doubtful)
    if not places:
        return ""
    said = joined([spoken(n) + (f" at {k} places" if k > 1 else "") for n, k in places.items()])
    trait = diagnosis.trait
    together = f" Together they add {trait}: one other cause may do all of it." if trait else ""
    return (
        f"Doubtful: {said}. The model predicts better with this torque, but the name may stand in "
        f"for something else.{together}"
    )


def not_following(joints: Sequence[str]) -> str:
    """Return that drives of joints report no torque of the motion; empty for none."""
    if len(joints) == 1:
        return f"The drive of {joints[0]} reports a torque that does not follow its motion"
    drives = f"The drives of {joined(joints)} report torques that do not follow their motion"
    return drives if joints else ""


def _progress(diagnosis: Diagnosis) -> str:
    """Return how far the error falls where the most of it is explained, beside the floor.

    With what the best model of the motion would leave, where that is less by more than the noise
    floor: the limit from which on the verdict takes the rest for a missing cause.
    """
    worst = max(_judged(diagnosis), key=lambda o: (o.before**2 - o.after**2) / _noise(o) ** 2)
    before, after = plain(worst.before, 2), plain(worst.after, 2)
    if before == after:
        floor = f"where noise leaves {plain(worst.floor, 2)}"
        return f"The error hardly changes: {after} {worst.unit} at {worst.output}, {floor}."
    whole = diagnosis.explained
    percent = f"{100.0 * whole:.0f} %" if whole < 0.995 else "more than 99 %"
    said = (
        f"The corrected model explains {percent} of the squared error: {before} -> {after} "
        f"{worst.unit} at {worst.output}"
    )
    if worst.after**2 - worst.attainable**2 <= worst.floor**2:
        return f"{said}."
    least = f"{plain(worst.attainable, 2)} {worst.unit}"
    return f"{said}, where the best model of the motion would leave {least}."


def _judged(diagnosis: Diagnosis) -> list[OutputLevel]:
    """Return the outputs that decided; a drive that was set aside says nothing of the robot."""
    return [output for output in diagnosis.outputs if output.judged]


def _noise(output: OutputLevel) -> float:
    return max(output.floor, 1e-150)


def _sum_up(findings: Sequence[Finding]) -> str:
    """Return the effects at their places, the certain first; many places are said once."""
    effects: dict[str, list[Finding]] = {}
    for finding in sorted(findings, key=lambda f: not f.certain):
        effects.setdefault(finding.effect.name, []).append(finding)
    said = []
    for alike in effects.values():
        together = len(alike) >= FEW and not any(finding.quantities for finding in alike)
        said += [_said_once(alike)] if together else [_said(finding) for finding in alike]
    if len(said) > FEW + 1:
        said = [*said[:FEW], f"{len(said) - FEW} more causes"]
    return joined(said)


def _said_once(findings: Sequence[Finding]) -> str:
    """Return one effect at many places, with the range of its size if it has one number."""
    effect = findings[0].effect
    said = f"{spoken(effect.name)} at {len(findings)} places"
    units = {e.unit for finding in findings for e in finding.parameters.values()}
    if len(findings[0].parameters) != 1 or len(units) != 1:
        return said
    sizes = [e.value for finding in findings for e in finding.parameters.values()]
    ends = dict.fromkeys((plain(min(sizes), 2), plain(max(sizes), 2)))
    size = f"{' to '.join(ends)} {units.pop()}".removesuffix(" 1")
    return f"{said} ({size})"


def _said(finding: Finding) -> str:
    """Return an effect at its place with its size; of many numbers those that a person checks."""
    place = f"{spoken(finding.effect.name)} at {finding.effect.where}"
    if finding.effect.search.drawn and not finding.quantities:
        return place
    if not finding.quantities:
        said = finding.effect.said({name: e.unit for name, e in finding.parameters.items()})
        given = [
            f"{spoken(name)} {plain(e.given)} {e.unit}".removesuffix(" 1")
            for name, e in finding.parameters.items()
            if e.given is not None
        ]
        return f"{said} (as given: {', '.join(given)})" if given else said
    shown = list(finding.quantities.items())[:FEW]
    sizes = ", ".join(
        f"{name} {plain(e.value)} {e.unit}".removesuffix(" 1")
        + (f" instead of {plain(e.given)}" if e.given is not None else "")
        for name, e in shown
    )
    return f"{place} ({sizes})"


@dataclass(frozen=True)
class Commands:
    """Command lines that go on from a diagnosis, made of what `wbc diagnose` was given.

    Attributes:
        logs: files, as the command line takes them.
        robot: name or file.
        saved: file in which the corrected robot is; None if in none.
        lossless: the robot was taken with perfect gears.
        columns: column map.
        add: effects to consider.
    """

    logs: Sequence[str]
    robot: str
    saved: str | None = None
    lossless: bool = False
    columns: str | None = None
    add: str = "auto"

    @property
    def target(self) -> str:
        """File of the corrected robot."""
        return self.saved or _SAVED

    def diagnose(self, *logs: str, save: str = "") -> str:
        """Return the command that diagnoses logs; it writes the corrected robot where asked to."""
        given = ["--robot", self.robot, *(["--lossless"] if self.lossless else []), *self._mapped]
        chosen = [] if self.add == "auto" else ["--add", self.add]
        return shlex.join(
            ["wbc", "diagnose", *logs, *given, *chosen, *(["--save", save] if save else [])]
        )

    @property
    def use(self) -> str:
        """What shows what the corrected robot leaves on the same logs; empty where none can."""
        if self.lossless and any("@" in log for log in self.logs):
            # The losses of logs of other machines would come back beside a robot with its own.
            return ""
        # Perfect gears would take the losses found out again: no --lossless here.
        return shlex.join(["wbc", "compare", *self.logs, "--robot", self.target, *self._mapped])

    @property
    def _mapped(self) -> list[str]:
        return ["--columns", self.columns] if self.columns else []


def what_to_do(diagnosis: Diagnosis, commands: Commands | None = None) -> str:
    """Return what to do now; lines that begin with four spaces are commands to copy.

    Args:
        diagnosis: the answer.
        commands: how to go on from it on the command line; in Python when left out.
    """
    verdict, asked = diagnosis.verdict, diagnosis.next_experiment
    lowered = f"{asked[:1].lower()}{asked[1:]}{_again(commands)}"
    match verdict:
        case "named":
            return f"{_USE} {_use(commands)}"
        case "partial":
            return f"{_USE} {_use(commands)}\nTo find the rest: {lowered}"
        case "none":
            return (
                "Neither the robot nor its model needs a change. Faster or loaded motions would "
                "show more."
            )
        case "not_repeatable":
            return f"Look at the robot first. {asked}{_again(commands, alone=True)}"
        case _ if diagnosis.findings:
            return f"{_DOUBTED} {_use(commands)}\nTo find out more: {lowered}"
        case _:
            return f"{_RECORD} {asked}{_again(commands)}"


def _use(commands: Commands | None) -> str:
    if commands is None:
        save = f'from wbc import save_robot; save_robot(found.robot, "{_SAVED}")'
        return f"Save it (`found` is this diagnosis):\n{COMMAND}{save}"
    save = "" if commands.saved else commands.diagnose(*commands.logs, save=_SAVED)
    shown = [f"{COMMAND}{line}" for line in (save, commands.use) if line]
    if save:
        look = " and see what it leaves" if commands.use else ""
        start = f"Save it{look}:"
    else:
        look = ". See what it leaves:" if commands.use else "."
        start = f"It is in {commands.target}{look}"
    return "\n".join([start, *shown, f"Then use {commands.target} in place of {commands.robot}."])


def _again(commands: Commands | None, *, alone: bool = False) -> str:
    """Return how to ask again: with what was recorded, or about the new runs alone."""
    if commands is None:
        return f" Then diagnose {'the new runs alone' if alone else 'all logs together'}."
    if alone:
        logs: Sequence[str] = _NEW_RUNS
        said = f"diagnose the new runs alone (with their names for {' and '.join(_NEW_RUNS)})"
    else:
        logs = (*commands.logs, _NEW_LOG)
        said = f"give all logs together (with the name of the new log for {_NEW_LOG})"
    return f"\nThen {said}:\n{COMMAND}{commands.diagnose(*logs)}"
