"""What the name of a foreign column suggests: quantity, unit, and whose it is."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from wbc.measurement.column_map import Mend, say_so
from wbc.measurement.schema import JOINT_QUANTITIES, LOG_UNITS, TIME, named_unit, split_column

MOTION = ("position", "velocity")
"""Quantities by which a file tells whose its columns are."""
_KINDS = {"s", *(unit for units in JOINT_QUANTITIES.values() for unit in units)} - {"1"}
_NAMED = [unit for unit, (kind, _) in LOG_UNITS.items() if kind in _KINDS]
# Words of a name in lower case -> the unit that they name.
_UNITS = {
    **{unit.lower().replace("/", " ").replace("^", " "): unit for unit in _NAMED},
    **{unit.lower().replace("/", " per "): unit for unit in _NAMED if "/" in unit},
    **{unit.lower().replace(" ", ""): unit for unit in _NAMED if "/" not in unit},
    **{"turns": "turn", "sec": "s", "seconds": "s", "c": "deg C"},
}

_QUANTITIES = {
    quantity: words.split()
    for quantity, words in {
        "time": "time t stamp timestamp clock tick zeit zeitstempel",
        "position": "q qpos pos position th theta phi angle ang winkel",
        "velocity": "v dq qd qvel vel velocity w om omega speed qdot geschwindigkeit",
        "motor_torque": "tau torque trq eff effort force qfrc moment drehmoment",
        "current": "i iq cur current amp amps strom",
        "temperature": "temp temperature",
    }.items()
}
_OF_KINDS = {"rad": "position", "rad/s": "velocity", "m/s": "velocity"}
_OF_KINDS |= {"N m": "motor_torque", "A": "current"}
"""What a unit measures -> the quantity that a name without one means."""
_VECTORS = {("observation", "state"): "position", ("action",): "target_position"}  # LeRobot's
_TARGETS = {"cmd", "ref", "des", "desired", "target", "goal", "command", "commanded", "set"}
_TARGETS |= {"control", "setpoint", "reference"}
_OF_OTHERS = {"ext", "external"}  # torques that no drive makes
_MEASURED = {"meas", "measured", "measurement", "act", "actual", "reported"}
_FILL = {*_MEASURED, "joint", "j", "motor", "rotor", "state", "est"}


@dataclass(frozen=True)
class NameGuess:
    """What a name suggests.

    Attributes:
        name: of the foreign column.
        quantity: of the schema, `time`, or empty where nothing is suggested.
        unit: as a column map names it; empty where none is suggested.
        owner: what is left of the name: a joint, by name or number.
        rotor: whether the name speaks of the motor or rotor.
    """

    name: str
    quantity: str
    unit: str
    owner: str
    rotor: bool = False


def guess_name(name: str) -> NameGuess:
    """Return what a name suggests; a name of the schema says what it is."""
    if native := split_column(name):
        return NameGuess(name, native[1], "", native[0])
    said = name.replace("°", "deg")
    unit, left = _unit(said)
    quantity, rest = _quantity(left)
    kind = LOG_UNITS[unit][0] if unit else ""
    quantity = quantity or _OF_KINDS.get(kind, "")
    if unit and kind not in {TIME: ("s",), **JOINT_QUANTITIES}.get(quantity, ()):
        unit = ""  # a word that only looks like one: the v of hip_v
        quantity, rest = _quantity(_words(said))
    if quantity and _OF_OTHERS & set(rest):
        quantity = ""
    if quantity and _TARGETS & set(rest) and not _MEASURED & set(rest):
        quantity = f"target_{quantity}" if quantity in ("position", "velocity") else ""
    return NameGuess(name, quantity, unit, _owner(rest), bool({"motor", "rotor"} & set(rest)))


def guess_names_of(names: Sequence[str]) -> list[NameGuess]:
    """Return what names suggest, each of the file; `j1.position` and `j_1.effort` are of one owner.

    A name of the schema keeps its joint as it stands, any other loses words like `joint`.
    """
    first: dict[str, str] = {}
    return [
        replace(guess, owner=first.setdefault(_owner(_words(guess.owner)), guess.owner))
        for guess in map(guess_name, names)
    ]


def joints_of(owners: Sequence[str], joints: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Return owner -> (joint, why): by name, by number along the chain, or by place in the file.

    Owners that differ in a number alone are a series, named as a whole. It is read by the names or
    numbers of the joints where every member meets just one joint so; else it counts along the
    chain: `q_0` to `q_5` of an arm whose joints are numbered at the wrist alone are its six joints
    from the base. A series that is shorter than what is left of the chain does not say which joints
    it means.

    Args:
        owners: in the order of the file.
        joints: of the robot, from the base to the tips.
    """
    words = {owner: set(owner.lower().split("_")) - {""} for owner in owners}
    # What all owners are called, such as a topic, tells none from the others.
    shared = set.intersection(*words.values()) if len(words) > 1 else set()
    own_words = {owner: own - shared for owner, own in words.items()}
    numbers = {joint: set(_words(joint)) for joint in joints}
    fitting = {
        owner: [j for j in joints if owner in (j, _owner(_words(j)))]
        or [j for j in joints if own and own <= numbers[j]]
        for owner, own in own_words.items()
    }
    counting = series(owners)
    met = [tuple(fitting[owner]) for owner in counting]
    told = all(len(m) == 1 for m in met) and len(set(met)) == len(met)
    others = {fitting[o][0] for o in owners if o not in counting and len(fitting[o]) == 1}
    counted = bool(counting) and not told and len(counting) >= len(joints) - len(others)
    named, left = dict[str, tuple[str, str]](), list(joints)
    for owner in owners:
        free = [j for j in fitting[owner] if j in left]
        if len(free) == 1 and (told or owner not in counting):
            named[owner] = (free[0], "by its name")
            left.remove(free[0])
    # What is left beside a series that was counted is no joint.
    why = "by its number along the chain" if counted else "by its place in the file"
    unnamed = [owner for owner in (counting if counted else owners) if owner not in named]
    return named | {owner: (joint, why) for owner, joint in zip(unnamed, left, strict=False)}


def channels(guesses: Sequence[NameGuess], whose: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Return channel -> entry of a column map, the first column that a name suggests for each.

    Args:
        guesses: in the order of the file; what is said of a motor counts after the joint's own.
        whose: owner -> joint.
    """
    found: dict[str, dict[str, str]] = {}
    for guess in sorted(guesses, key=lambda guess: guess.rotor and guess.quantity in MOTION):
        if guess.owner in whose and guess.quantity not in ("", TIME):
            unit = {"unit": guess.unit} if guess.unit else {}
            name = f"{whose[guess.owner]}.{guess.quantity}"
            found.setdefault(name, {"from": guess.name, **unit})
    return found


def _owner(words: Sequence[str]) -> str:
    return "_".join(word for word in words if word not in _FILL | _TARGETS)


def series(names: Sequence[str]) -> list[str]:
    """Return the names that differ in one number alone and count without a hole, in their order."""
    groups: dict[tuple[str, str], dict[int, str]] = {}
    for name in names:
        for number in re.finditer(r"\d+", name):
            key = name[: number.start()], name[number.end() :]
            groups.setdefault(key, {})[int(number[0])] = name
    longest = max(groups.values(), key=len, default={})
    ends = sorted(longest)
    whole = len(ends) > 1 and ends[0] in (0, 1) and ends[-1] - ends[0] == len(ends) - 1
    return [longest[number] for number in ends] if whole else []


def unread(ignored: Sequence[str], missing: Sequence[str]) -> tuple[str, Mend]:
    """Return what to do if a column that was not read is a channel that is missing.

    Args:
        ignored: columns of the file that were not read.
        missing: channels; several quantities of one joint are ways to say the same, and one stands
            for all where no name looks like any.

    Returns:
        A sentence with the lines of a map, empty where every column was read; and the map that
        reads columns whose names look like the channels, one for every joint, empty where none do.
    """
    wanted = [parts for parts in map(split_column, missing) if parts is not None]
    quantities = {quantity for _, quantity in wanted}
    fitting = [guess for guess in map(guess_name, ignored) if guess.quantity in quantities]
    joints = list(dict.fromkeys(joint for joint, _ in wanted))
    owners = list(dict.fromkeys(guess.owner for guess in fitting))
    whose = {
        owner: joint
        for owner, (joint, why) in joints_of(owners, joints).items()
        if len(owners) == len(joints) or why == "by its name"
    }
    found: dict[str, tuple[str, dict[str, str]]] = {}
    for name, entry in channels(fitting, whose).items():
        if (parts := split_column(name)) in wanted and parts:
            found.setdefault(parts[0], (name, entry))
    names = [entry["from"] for _, entry in found.values()] or ignored
    quoted = ", ".join(f"'{name}'" for name in names)
    told = f"Column {quoted} was" if len(names) == 1 else f"Columns {quoted} were"
    if found:
        mend = {"columns": dict(found.values())}
        missed = f"{', '.join(mend['columns'])} {'is' if len(found) == 1 else 'are'}"
        return f"{told} not read, and {missed} missing. If they are the same, {say_so(mend)}", mend
    if not ignored or not missing:
        return "", {}
    first = {joint: f"{joint}.{quantity}" for joint, quantity in reversed(wanted)}
    way = asked(ignored, [first[joint] for joint in joints])
    return f"{told} not read, for want of a known name. {way}", {}


def asked(names: Sequence[str], channels: Sequence[str]) -> str:
    """Return what to say if columns without a known name hold some channels along the chain."""
    counting = series(names)
    pairs = dict(zip(channels, counting, strict=False))
    way = f"If {channels[0]} is there, put the name of its column in place of COLUMN, and "
    if len(pairs) == len(channels):
        way = f"If {counting[0]} to {counting[-1]} are {channels[0]} and so on along the chain, "
    else:
        pairs = {channels[0]: "COLUMN"}
    return way + say_so({"columns": {channel: {"from": name} for channel, name in pairs.items()}})


def _words(name: str) -> list[str]:
    """Return the words and numbers of a name in lower case; `hipVel` is two words."""
    spaced = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    return [word.lower() for word in re.findall(r"[A-Za-z]+|[0-9]+", spaced)]


def _unit(name: str) -> tuple[str, list[str]]:
    """Return (unit, the other words); a unit stands in brackets, or at the end.

    Before a joint's number it has two letters or more. The capital of `mNm` or `mA` begins no word.
    """
    for bracket in re.finditer(r"[\[(]([^\])]+)[\])]", name):
        if (unit := named_unit(bracket[1])) in _NAMED:
            return unit, _words(name[: bracket.start()] + " " + name[bracket.end() :])
    if numbered := re.fullmatch(r"(.*[A-Za-z])(\W|_)([0-9]+)", name):
        unit, left = _unit(numbered[1])
        if len(unit) > 1:
            return unit, [*left, numbered[3]]
    for found in (list(re.finditer(r"[A-Za-z]+|[0-9]+", name)), None):
        words = [match[0].lower() for match in found] if found else _words(name)
        for count in (3, 2, 1):
            said = " ".join(words[-count:])
            if len(words) > count and said in _UNITS:
                left = _words(name[: found[-count].start()]) if found else words[:-count]
                return _UNITS[said], left
    return "", _words(name)


def _quantity(tokens: list[str]) -> tuple[str, list[str]]:
    for quantity, words in _QUANTITIES.items():
        for k, token in enumerate(tokens):
            single = re.sub(r"(?<=..)(ie)?s$", lambda end: "y" if end[1] else "", token)
            if {token, single} & {*words}:
                # A topic and its field often say the same: /torques/hip/effort.
                left = [t for t in tokens[k + 1 :] if len(t) < 3 or t not in words]
                return quantity, tokens[:k] + left
    for vector, quantity in _VECTORS.items():
        if set(vector) <= set(tokens):
            return quantity, [token for token in tokens if token not in vector]
    return "", tokens
