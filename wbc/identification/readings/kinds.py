"""The mistakes that people make with columns: each is a map that reads the log without it.

A reading is a column map beside a sentence and a prior. Whatever holds a log against something else
asks the map what it makes of the columns, so that what is judged is what is printed and applied.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations, product
from math import degrees, exp, log as ln
from typing import Any, TypeAlias

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.identification.readings.log_rows import Described, LogRows, without_gravity
from wbc.measurement.column_map import ENCODER_RATES, Mend
from wbc.measurement.column_mistakes import COUNTS_OF_A_TURN, EVERYWHERE, log_mixture, whole_counts
from wbc.measurement.log import Log, listed
from wbc.measurement.schema import LOG_UNITS
from wbc.robot import Robot
from wbc.robot.coordinates import slides

_SOMEWHERE = ln(0.01)
_RARE = ln(0.003)
LINKS = "links"
"""Kind of a reading in which no column is wrong, but the description of links."""
_GRAVITY = "robot.toml must say so, at its top:\n"
_GRAVITY += '    gravity = {{ value = {}, unit = "m/s^2", source = "{}" }}'
_COUPLED = "robot.toml must say so:\n    [transmission]\n"
_COUPLED += '    topology = {{ value = {}, unit = "1", source = "the logs" }}'
_SUMS = {1.0: "sum", -1.0: "difference"}
_WHOLE = "record the whole torque (an option of the driver). For torques that never held gravity, "
Lag: TypeAlias = tuple[Sequence[int], float]
Turn: TypeAlias = tuple[int, float, float, tuple[int, ...], tuple[int, ...] | None]

# How far turning joints travel in a log [rad]: 32 joints of seven recorded robots have a median of
# 1.8 and a standard deviation of the logarithm of 0.84. One in ten may be anything else.
_TRAVEL, _TRAVEL_SPREADS = 1.8, ((0.9, 0.84), (0.1, 1.5))
_HELD = _TRAVEL * exp(-3.0 * _TRAVEL_SPREADS[0][1])  # a joint that is held trembles by anything


@dataclass(frozen=True, eq=False)
class Reading:
    """One way to read the columns of a log; the default changes nothing.

    Attributes:
        kind: short name for machines, empty for the log as it stands.
        text: what is wrong, as a clause; empty for the log as it stands.
        prior: log probability before the rows are seen.
        mend: the map that reads the log so.
        described: robot -> what it must be instead; None where only columns are read otherwise.
        way: what to do where no column is wrong.
        behind: driven joints whose need stays as it is: those behind links that are not as drawn.
        exchanged: driven joints that have each other's columns.
        logs: numbers of those that are read so, None for all.
    """

    kind: str = ""
    text: str = ""
    prior: float = ln(0.8)
    mend: Mend = field(default_factory=dict)
    described: Described | None = None
    way: str = ""
    behind: tuple[int, ...] = ()
    exchanged: tuple[int, ...] = ()
    logs: tuple[int, ...] | None = None


def readings(
    rows: LogRows, lost: BoolArray, doubtful: bool, lags: Sequence[Lag], turns: Sequence[Turn]
) -> Iterator[Reading]:
    """Yield every mistake with the reading that undoes it.

    Args:
        rows: of the first log; others have the same columns.
        lost: (m,) driven joints whose report does not follow the need as the log stands; only
            theirs may be exchanged.
        doubtful: whether any report leaves more than physics usually does; only then gravity
            is asked about.
        lags: joints, by number, whose torques share a lag [s].
        turns: single joints, by number, what may have to be added to their positions [rad], the
            log prior of it, and the numbers of the logs; and of links that may be turned instead,
            the driven joints behind them.
    """
    yield from _signs_and_sides(rows)
    yield from _units(rows)
    yield from _exchanges(rows, lost)
    yield from _late(rows, lags)
    yield from _turned(rows, turns)
    if doubtful:
        yield from _couplings(rows)
        yield from _gravities(rows) if rows.weighs else ()


def _signs_and_sides(rows: LogRows) -> Iterator[Reading]:
    """Yield torques and positions of the other sign, and torques of the other side of the gear."""
    ratios = dict(zip(rows.torques, map(float, rows.robot.transmission.gear_ratio), strict=True))
    for names in _all_or_one(rows.torques):
        chosen, many = listed(names), len(names) > 1
        text = f"the sign{'s' if many else ''} of {chosen} {'are' if many else 'is'} reversed"
        prior = EVERYWHERE if many else _SOMEWHERE
        yield _mended("torque_sign", text, prior, {name: {"sign": -1} for name in names})
        quantities = {name.rpartition(".")[2] for name in names}
        if all(abs(ratios[name]) == 1.0 for name in names) or len(quantities) > 1:
            continue
        prior = EVERYWHERE if names == rows.torques else _RARE
        for power in (1.0, -1.0):
            columns: Mend = {name: {"scale": abs(ratios[name]) ** power} for name in names}
            text = f"the gear ratio was applied once too often to {chosen}"
            if quantities == {"current"}:
                text = f"the torque constants behind {chosen} belong to the other side of the gear"
            if (quantities, power) in (({"rotor_torque"}, -1.0), ({"motor_torque"}, 1.0)):
                side, when = ("motor", "after") if power < 0.0 else ("rotor", "before")
                text = f"the log gives torque {when} the reduction as {chosen}"
                columns = {name: {"side": side, "gear_ratio": ratios[name]} for name in names}
            yield _mended("gear_side", text, prior, columns)
    for joint in rows.robot.single_joints:
        mirrored = {name: {"sign": -1} for name in encoder_columns(rows.log, joint)}
        text = f"the sign of {joint}.position is reversed"
        yield _mended("position_sign", text, _SOMEWHERE, mirrored)


def _units(rows: LogRows) -> Iterator[Reading]:
    """Yield torques and angles in other units."""
    names, driven = rows.torques, rows.robot.transmission.joints
    # A torque, a force and a current have no unit in common. Those of one kind have one: drivers
    # give the same unit to all joints.
    kinds: dict[str, list[str]] = {}
    for name, joint in zip(names, driven, strict=True):
        sliding = slides(rows.robot, joint)
        kind = "mA" if name.endswith(".current") else "mN" if sliding else "N mm"
        kinds.setdefault(kind, []).append(name)
    for kind, chosen in kinds.items():
        for unit in ("N mm", "N cm") if kind == "N mm" else (kind,):
            columns = {name: {"unit": unit} for name in chosen}
            yield _mended("torque_unit", f"{_holds(chosen)} {unit}", EVERYWHERE, columns)
    if counted := whole_counts(rows.log):
        for turn, worth in COUNTS_OF_A_TURN.items():
            text = f"{_holds(counted)} counts of an encoder of {turn} a turn"
            prior = EVERYWHERE - ln(len(COUNTS_OF_A_TURN))
            yield _mended("counts", text, prior, {name: {"scale": worth} for name in counted})
        return
    turning = [joint for joint in rows.robot.single_joints if not slides(rows.robot, joint)]
    for joints, unit in product(_all_or_one(turning) if turning else [], ("deg", "turn")):
        # One excitation moves all joints: their travels are one observation.
        worth = LOG_UNITS[unit][1]
        travels = float(np.mean([_travels(rows.log, joint, worth) for joint in joints]))
        name = "degrees" if unit == "deg" else "turns"
        text = f"{_holds([f'{joint}.position' for joint in joints])} {name}"
        prior = (EVERYWHERE if joints == turning else _RARE) + travels
        yield Reading("degrees", text, prior, in_degrees(rows.log, joints, unit))


def _travels(log: Log, joint: str, factor: float) -> float:
    """Return by how much a joint's travel is more usual if its position is multiplied [nats]."""
    travel = float(np.ptp(log.column(f"{joint}.position")))
    away = np.log(np.maximum(np.array([1.0, factor]) * travel, _HELD) / _TRAVEL)
    return float(np.diff(log_mixture(away, _TRAVEL_SPREADS))[0])


def _exchanges(rows: LogRows, lost: BoolArray) -> Iterator[Reading]:
    """Yield pairs of joints whose columns are exchanged."""
    driven, names = rows.robot.transmission.joints, rows.torques
    for a, b in combinations(map(int, np.flatnonzero(lost)), 2):
        one, other = driven[a], driven[b]
        moved = columns_of(other, encoder_columns(rows.log, other), one)
        moved |= columns_of(one, encoder_columns(rows.log, one), other)
        crossed = {names[a]: {"from": names[b]}, names[b]: {"from": names[a]}}
        ways = [("positions", moved)]
        if names[a].rpartition(".")[2] == names[b].rpartition(".")[2]:
            ways += [("torques", crossed), ("positions and torques", {**moved, **crossed})]
        for what, columns in ways:
            text = f"the {what} of {one} and {other} are exchanged"
            yield _mended("exchanged", text, _RARE, columns, exchanged=(a, b))


def _late(rows: LogRows, lags: Sequence[Lag]) -> Iterator[Reading]:
    """Yield torques that are late. A low-pass is a delay for what is slower than it."""
    for joints, lag in lags:
        lag = float(f"{lag:.1g}")  # joints and logs differ in the next digit
        late = [rows.torques[k] for k in joints]
        text = f"{listed(late)} {'lags' if len(late) == 1 else 'lag'} by {1e3 * lag:.0f} ms"
        text += ": a delay, or a low-pass as long"
        yield _mended("torque_late", text, _SOMEWHERE, {name: {"lag": lag} for name in late})


def _turned(rows: LogRows, turns: Sequence[Turn]) -> Iterator[Reading]:
    """Yield positions whose zero is another one, and links that are not as drawn.

    Turned, and with any gain, links have any moment about their joint.
    """
    for single, offset, prior, logs, behind in turns:
        joint = rows.robot.single_joints[single]
        kind, way = "position_zero", ""
        text = f"the zero of {joint}.position is off by {degrees(-offset):.0f} degrees"
        if behind is not None:
            kind, way = LINKS, "correct their inertias in the model file."
            text = f"links that {joint} moves are not as drawn"
        names = [n for n in encoder_columns(rows.log, joint) if n.endswith("position")]
        columns = {name: {"offset": offset} for name in names}
        yield _mended(kind, text, prior, columns, way=way, logs=logs, behind=behind or ())


def _gravities(rows: LogRows) -> Iterator[Reading]:
    """Yield no gravity, and gravity along the other axes of the base that need another torque."""
    why, none = "the driver takes it out", without_gravity
    text = f"{_holds(rows.torques)} no gravity: {why}"
    way = _WHOLE + _GRAVITY.format([0, 0, 0], why)
    yield Reading("no_gravity", text, EVERYWHERE, described=none, way=way)
    stated, axes = rows.robot.model.gravity.linear, np.vstack([np.eye(3), -np.eye(3)])
    nearest, weightless = int(np.argmax(axes @ stated)), rows.need(described=none).links
    for k, axis in enumerate(axes):
        pull = (np.round(np.linalg.norm(stated), 4) * axis + 0.0).tolist()  # 0, not -0
        other = partial(Robot.with_gravity, gravity=pull)
        if k == nearest or np.allclose(rows.need(described=other).links, weightless):
            continue
        why = "mounted upside down" if k % 3 == nearest % 3 else "mounted on its side"
        text = f"gravity acts along {'+-'[k // 3]}{'xyz'[k % 3]} of the base: the robot is {why}"
        # The five directions together are as likely as no gravity.
        way, prior = _GRAVITY.format(pull, why), EVERYWHERE - ln(5.0)
        yield Reading("gravity_direction", text, prior, described=other, way=way)


def _couplings(rows: LogRows) -> Iterator[Reading]:
    """Yield motors that are mounted before the previous joint, and turn with both joints.

    Parallelograms and belts drive legs and arms so. The motor of joint a then does not carry what
    joint b behind it needs:  psi_b = q_b +- q_a,  and the motor of a gives tau_a -+ tau_b.
    """
    gears, model = rows.robot.transmission, rows.robot.model
    places = {model.getJointId(joint): k for k, joint in enumerate(gears.joints)}
    if not np.array_equal(gears.topology, np.eye(gears.size)) or np.isfinite(rows.sensed).any():
        return
    pairs = [(places.get(model.parents[number]), b) for number, b in places.items()]
    for (a, b), sign in product(pairs, (1.0, -1.0)):
        if a is None:
            continue
        topology = np.eye(gears.size)
        topology[b, a] = -sign
        one, other = gears.joints[a], gears.joints[b]
        text = f"the motor of {other} turns with {one}, too, by the {_SUMS[sign]} of both angles"
        way = _COUPLED.format(topology.tolist())
        coupled = partial(_driven_by, topology=topology)
        yield Reading("coupling", text, _RARE, described=coupled, way=way)


def _driven_by(robot: Robot, topology: FloatArray) -> Robot:
    """Return a robot whose motors drive its joints through another topology."""
    return robot.with_transmission(replace(robot.transmission, topology=topology))


def _mended(
    kind: str, text: str, prior: float, columns: Mapping[str, Mapping[str, Any]], **more: Any
) -> Reading:
    return Reading(kind, text, prior, {"columns": columns}, **more)


def _all_or_one(names: Sequence[str]) -> list[list[str]]:
    return [list(names), *([name] for name in names if len(names) > 1)]


def _holds(names: Sequence[str]) -> str:
    return f"{listed(names)} {'holds' if len(names) == 1 else 'hold'}"


def in_degrees(log: Log, joints: Iterable[str], unit: str = "deg") -> Mend:
    """Return the mend of a log whose encoder columns of some joints are in degrees or turns."""
    rates = {name: rate for joint in joints for name, rate in encoder_columns(log, joint).items()}
    return {"columns": {name: {"unit": f"{unit}{rate}"} for name, rate in rates.items()}}


def encoder_columns(log: Log, joint: str) -> dict[str, str]:
    """Return the columns of a joint that turn with its encoder -> what their unit has more."""
    known = {f"{joint}.{quantity}": rate for quantity, rate in ENCODER_RATES.items()}
    return {name: rate for name, rate in known.items() if name in log.columns}


def columns_of(theirs: str, names: Iterable[str], ours: str) -> dict[str, dict[str, str]]:
    """Return the entries of a map by which a joint gets columns, among `names`, of another one."""
    own = [name for name in names if name.startswith(f"{theirs}.")]
    return {f"{ours}{name.removeprefix(theirs)}": {"from": name} for name in own}
