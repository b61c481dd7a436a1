"""Was a diagnosis right? Every question of the scorecard, asked of one result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

CERTAIN = 0.95  # probability from which on a cause counts as certain
FLOORS = 5.0  # from here on what no listed effect explains must be called unknown


@dataclass(frozen=True)
class Judged:
    """One result held against its truth.

    Attributes:
        result: as written.
        kind: `nothing`, `below` (one cause, below the floor), `one`, `two`, `three`, `outside`,
            `outside small`, `mixed` (a cause of the list beside one outside), `mixed small`.
        covered: every cause that is felt is among the names, or a stand-in of it.
        placed: exactly the causes that are felt, each where it is, nothing else.
        names: how many names the answer gives for one cause.
        size: of the smallest cause that is felt, in floors.
    """

    result: dict[str, Any]
    kind: str
    covered: bool
    placed: bool
    names: int
    size: float

    @property
    def good(self) -> bool:
        """Whether nothing was missed and nothing invented."""
        verdict = self.result["verdict"]
        if self.kind == "nothing":
            return bool(verdict == "none")
        if self.kind in ("outside small", "mixed small"):
            return True
        if self.kind == "mixed":
            return bool(verdict in ("partial", "unknown")) and not false_certain(self.result)
        return bool(verdict == "unknown") if self.kind == "outside" else self.covered


def judge_result(result: dict[str, Any]) -> Judged:
    """Return what was right about a result."""
    causes = result["causes"]
    felt = [cause for cause in causes if cause["felt"]]
    kind = {0: "nothing", 1: "one", 2: "two"}.get(len(causes), "three")
    if result["unlisted"]:
        kind = "outside" if result["unexplained"] >= FLOORS else "outside small"
        kind = kind.replace("outside", "mixed") if len(causes) > 1 else kind
    elif len(causes) == 1 and not felt:
        kind = "below"
    named = named_set(result)
    answered = result["verdict"] in ("named", "ambiguous")
    if kind == "below":
        allowed = {causes[0]["effect"], *causes[0]["stand_ins"]}
        covered = result["verdict"] == "none" or (answered and bool(named & allowed))
    else:
        covered = answered and all(_stands_in(cause, named, result["merged"]) for cause in felt)
    places = {_place(entry["effect"], entry["where"]) for entry in result["found"]}
    wanted = {_place(cause["effect"], where) for cause in felt for where in cause["where"]}
    return Judged(
        result,
        kind,
        covered,
        covered and places == wanted,
        len(named),
        min((cause["size"] for cause in felt), default=0.0),
    )


def _one_name(name: str) -> str:
    """Return a cause's name: the drawing of all links is wrong where that of one is."""
    return "link_inertia" if name == "link_inertias" else name


def _place(name: str, where: str) -> tuple[str, str]:
    """Return what is found where; logs tell sums over links, not whose drawing is wrong."""
    name = _one_name(name)
    return name, "drawing" if name == "link_inertia" else where


def named_set(result: dict[str, Any]) -> set[str]:
    """Return every name that the answer gives: effects found and their alternatives."""
    return {name for entry in result["found"] for name in _names(entry)}


def _names(entry: dict[str, Any]) -> set[str]:
    """Return the name of an entry of an answer and those of its alternatives."""
    rivals = (a.split(" at ")[0] for a in entry["alternatives"])
    return {_one_name(name) for name in (entry["effect"], *rivals)}


def _stands_in(cause: dict[str, Any], named: set[str], merged: list[Any]) -> bool:
    joint = {name for pair, name in merged if cause["effect"] in pair}
    return bool(named & {cause["effect"], *cause["stand_ins"], *joint})


def first_right(result: dict[str, Any]) -> bool:
    """Whether only the one cause is named, or what can stand for it."""
    cause = result["causes"][0]
    return named_set(result) <= {cause["effect"], *cause["stand_ins"]}


def invented(result: dict[str, Any]) -> bool:
    """Whether an effect was added that is no cause and stands for none."""
    allowed = {name for _, name in result["merged"]}
    for cause in result["causes"]:
        allowed |= {cause["effect"], *cause["stand_ins"]}
    return any(not allowed & _names(entry) for entry in result["found"])


def certain(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the entries of an answer that it states with at least 0.95; none in older results."""
    return [entry for entry in result["found"] if (entry.get("probability") or 0.0) >= CERTAIN]


def certain_names(result: dict[str, Any]) -> set[str]:
    """Return the names of what an answer states with at least 0.95."""
    return {_one_name(entry["effect"]) for entry in certain(result)}


def false_certain(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the certain entries that are no cause and stand for none."""
    return [entry for entry in certain(result) if not is_true(result, entry)]


def is_true(result: dict[str, Any], entry: dict[str, Any]) -> bool:
    """Whether an entry of an answer is hidden, or stands for what is; tied causes as a group."""
    allowed = {name for _, name in result["merged"]}
    for cause in result["causes"]:
        allowed |= {cause["effect"], *cause["stand_ins"], *cause.get("equals", ())}
    return bool(_names(entry) & allowed)


def intervals(judged: Judged) -> list[tuple[str, str, float, float, float, float]]:
    """Return (effect, parameter, truth, value, low, high) where just the truth was found."""
    if not judged.placed:
        return []
    found = {(entry["effect"], entry["where"]): entry for entry in judged.result["found"]}
    rows = []
    for effect, where, values in judged.result["flaws"]:
        if (effect, where) not in found:
            continue
        for name, truth in values.items():
            estimate = found[effect, where]["parameters"].get(name)
            if estimate is not None:
                rows.append((effect, name, float(truth), *estimate))
    return rows
