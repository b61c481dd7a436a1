"""The mistakes that people make with columns, each with how the log reads without it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import log as ln
from math import pi
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.measurement.evidence import Report, report
from wbc.measurement.findings import ENCODER_UNITS, Mend, in_degrees
from wbc.measurement.log import Log
from wbc.measurement.log_rows import LogRows, Need
from wbc.robot.coordinates import slides

# How often a set of logs has a mistake of a kind: a judgement, nobody counted. A factor 3 moves a
# decision by one nat; clear cases have ten or more.
_EVERYWHERE = ln(0.02)
_SOMEWHERE = ln(0.01)
_RARE = ln(0.003)
_PARTS = 3  # of a log, in each of which a correction must bring the reports closer to the need

# How far turning joints travel in a log [rad]: 32 joints of seven recorded robots have a median of
# 1.8 and a standard deviation of the logarithm of 0.84. One in ten may be anything else.
_TRAVEL, _TRAVEL_SPREAD = 1.8, 0.84
_OTHER, _OTHER_SPREAD = 0.1, 1.5

_TORQUE_UNITS = {"N mm": ("N mm", 1e-3), "N cm": ("N cm", 1e-2)}
_FORCE_UNITS = {"mN": ("mN", 1e-3)}  # of joints that slide
_CURRENT_UNITS = {"mA": ("mA", 1e-3)}


@dataclass(frozen=True, eq=False)
class Reading:
    """One way to read the columns of a log.

    Attributes:
        kind: short name for machines, empty for the log as it stands.
        text: what is wrong, as a clause; empty for the log as it stands.
        prior: log probability before the rows are seen.
        order: (n,) single joint i has the position column of single joint order[i] ...
        factor: (n,) ... times this.
        torque_order: (m,) the same of the driven joints' torque columns ...
        torque_factor: (m,) ... times this, in the unit of the column.
        mend: what a column map says about it.
        columns: the columns that are wrong.
        weight: share of what gravity needs that the torques hold: 1, 0 without, -1 upside down.
        offset: (n,) added to the positions of the single joints [rad, m].
        lag: by how much the torques are late [s].
        told: whether nothing that the readings do not hold needs the same torque; else it is asked.
    """

    kind: str
    text: str
    prior: float
    order: IntArray
    factor: FloatArray
    torque_order: IntArray
    torque_factor: FloatArray
    mend: Mend
    columns: tuple[str, ...] = ()
    weight: float = 1.0
    lag: float = 0.0
    offset: FloatArray | None = None
    told: bool = True

    @property
    def place(self) -> bytes:
        """What the need of the links depends on."""
        zero = b"" if self.offset is None else self.offset.tobytes()
        return b"".join((self.order.tobytes(), self.factor.tobytes(), zero, b"%g" % self.weight))

    def torque(self, rows: LogRows) -> FloatArray:
        """Return the torque (N, m) at the motors' outputs that the log reports, read so."""
        factor = self.torque_factor * rows.conversion / rows.conversion[self.torque_order]
        torque = rows.late(self.lag) if self.lag else rows.torque
        return np.asarray(torque[:, self.torque_order] * factor)


def readings(
    rows: LogRows, log: Log, lost: BoolArray, doubtful: bool, lag: float
) -> Iterator[Reading]:
    """Yield the log as it stands, and then every mistake with the reading that undoes it.

    Args:
        rows: of the log.
        log: names the columns.
        lost: (m,) driven joints whose report does not follow the need as the log stands; only
            theirs may be exchanged.
        doubtful: whether any report leaves more than physics usually does; only then gravity and
            zeros are asked about.
        lag: that all torques share [s], 0 for none.
    """
    as_is = as_it_stands(rows)
    yield as_is
    yield from _signs(rows, log, as_is)
    yield from _units(rows, log, as_is)
    yield from _sides(rows, as_is)
    yield from _exchanges(rows, log, lost, as_is)
    if lag:
        yield _late(rows, as_is, lag)
    if doubtful:
        yield from _left_out(rows, as_is)
        yield from _zeros(rows, log, as_is)


def as_it_stands(rows: LogRows) -> Reading:
    """Return the reading that changes nothing."""
    driven = rows.robot.transmission.size
    return Reading("", "", ln(0.8), *rows.as_read, np.arange(driven), np.ones(driven), {})


def _signs(rows: LogRows, log: Log, as_is: Reading) -> Iterator[Reading]:
    """Yield torques and positions whose sign is the other way round."""
    driven, names = rows.robot.transmission.joints, _torque_columns(rows)
    if len(driven) > 1:
        yield replace(
            as_is,
            kind="torque_sign",
            text=f"the signs of {listed(names)} are reversed",
            prior=_EVERYWHERE,
            torque_factor=-as_is.torque_factor,
            **_with({name: {"sign": -1} for name in names}),
        )
    for k, name in enumerate(names):
        yield replace(
            as_is,
            kind="torque_sign",
            text=f"the sign of {name} is reversed",
            prior=_SOMEWHERE,
            torque_factor=_put(as_is.torque_factor, [k], -1.0),
            **_with({name: {"sign": -1}}),
        )
    for i, joint in enumerate(rows.robot.single_joints):
        moving = encoder_columns(log, joint)
        yield replace(
            as_is,
            kind="position_sign",
            text=f"the sign of {joint}.position is reversed",
            prior=_SOMEWHERE,
            factor=_put(as_is.factor, [i], -1.0),
            **_with({name: {"sign": -1} for name in moving}),
        )


def _units(rows: LogRows, log: Log, as_is: Reading) -> Iterator[Reading]:
    """Yield torques and angles in other units."""
    names, driven = _torque_columns(rows), rows.robot.transmission.joints
    for k in _all_or_one(len(names)):
        chosen = [names[i] for i in k]
        currents = all(name.endswith(".current") for name in chosen)
        sliding = [slides(rows.robot, driven[i]) for i in k]
        units = _CURRENT_UNITS if currents else _FORCE_UNITS if all(sliding) else _TORQUE_UNITS
        if any(sliding) and not all(sliding) and not currents:
            continue  # a torque and a force have no unit in common
        for said, (unit, factor) in units.items():
            yield replace(
                as_is,
                kind="torque_unit",
                text=f"{_holds(chosen)} {said}",
                prior=_EVERYWHERE if len(k) == len(names) else _RARE,
                torque_factor=_put(as_is.torque_factor, k, factor),
                **_with({name: {"unit": unit} for name in chosen}),
            )
    single = rows.robot.single_joints
    turning = [i for i, joint in enumerate(single) if not slides(rows.robot, joint)]
    for k in _all_or_one(len(turning)) if turning else []:
        places = [turning[i] for i in k]
        mend = in_degrees(log.columns, [single[i] for i in places])
        yield replace(
            as_is,
            kind="degrees",
            text=f"{_holds([f'{single[i]}.position' for i in places])} degrees",
            prior=(_EVERYWHERE if len(k) == len(turning) else _RARE)
            # One excitation moves all joints: their travels are one observation.
            + float(np.mean([_travels(log, single[i], pi / 180.0) for i in places])),
            factor=_put(as_is.factor, places, pi / 180.0),
            mend=mend,
            columns=tuple(mend["columns"]),
        )


def _travels(log: Log, joint: str, factor: float) -> float:
    """Return by how much a joint's travel is more usual if its position is multiplied [nats]."""
    travel = float(np.ptp(log.column(f"{joint}.position")))
    away = np.log(np.maximum(np.array([1.0, factor]) * travel, 1e-12) / _TRAVEL)
    usual = np.log((1.0 - _OTHER) / _TRAVEL_SPREAD) - 0.5 * (away / _TRAVEL_SPREAD) ** 2
    other = np.log(_OTHER / _OTHER_SPREAD) - 0.5 * (away / _OTHER_SPREAD) ** 2
    density = np.logaddexp(usual, other)
    return float(density[1] - density[0])


def _sides(rows: LogRows, as_is: Reading) -> Iterator[Reading]:
    """Yield torques of the other side of the gear."""
    names, ratio = _torque_columns(rows), rows.robot.transmission.gear_ratio
    for k in _all_or_one(len(names)):
        if np.all(np.abs(ratio[k]) == 1.0) or len({rows.quantities[i] for i in k}) > 1:
            continue
        chosen, quantity = [names[i] for i in k], rows.quantities[k[0]]
        prior = _EVERYWHERE if len(k) == len(names) else _RARE
        for power, (cause, key) in _SIDES[quantity].items():
            factors = np.abs(ratio[k]) ** power if key == "scale" else ratio[k] ** power
            side = "motor" if quantity == "rotor_torque" else "rotor"
            yield replace(
                as_is,
                kind="gear_side",
                text=cause.format(listed(chosen)),
                prior=prior,
                torque_factor=_put(as_is.torque_factor, k, factors),
                **_with(
                    {
                        name: {"scale": float(f)}
                        if key == "scale"
                        else {"side": side, "gear_ratio": float(ratio[i])}
                        for name, f, i in zip(chosen, factors, k, strict=True)
                    }
                ),
            )


_TWICE = "the gear ratio was applied once too often to {}"
_CONSTANT = "the torque constants behind {} belong to the other side of the gear"
_SIDES: dict[str, dict[float, tuple[str, str]]] = {
    "rotor_torque": {
        -1.0: ("the log gives torque after the reduction as {}", "side"),
        1.0: (_TWICE, "scale"),
    },
    "motor_torque": {
        1.0: ("the log gives torque before the reduction as {}", "side"),
        -1.0: (_TWICE, "scale"),
    },
    "current": {-1.0: (_CONSTANT, "scale"), 1.0: (_CONSTANT, "scale")},
}
"""Quantity -> power of the gear ratio that mends it -> (what is wrong, key of the map)."""


def _exchanges(rows: LogRows, log: Log, lost: BoolArray, as_is: Reading) -> Iterator[Reading]:
    """Yield pairs of joints whose columns are exchanged."""
    driven, single = rows.robot.transmission.joints, list(rows.robot.single_joints)
    names = _torque_columns(rows)
    for a, b in combinations(map(int, np.flatnonzero(lost)), 2):
        both = f"{driven[a]} and {driven[b]}"
        moved = {
            f"{one}.{name.removeprefix(other + '.')}": {"from": name}
            for one, other in ((driven[a], driven[b]), (driven[b], driven[a]))
            for name in encoder_columns(log, other)
        }
        order = _exchanged(as_is.order, single.index(driven[a]), single.index(driven[b]))
        moves: dict[str, Any] = {"order": order}
        yield replace(
            as_is,
            kind="exchanged",
            text=f"the positions of {both} are exchanged",
            prior=_RARE,
            **moves,
            **_with(moved),
        )
        if rows.quantities[a] != rows.quantities[b]:
            continue
        torques = {names[a]: {"from": names[b]}, names[b]: {"from": names[a]}}
        crossed = _exchanged(as_is.torque_order, a, b)
        nothing: dict[str, Any] = {}
        for text, also, mend in (
            (f"the torques of {both} are exchanged", nothing, torques),
            (f"the positions and torques of {both} are exchanged", moves, {**moved, **torques}),
        ):
            yield replace(
                as_is,
                kind="exchanged",
                text=text,
                prior=_RARE,
                torque_order=crossed,
                **also,
                **_with(mend),
            )


def _left_out(rows: LogRows, as_is: Reading) -> Iterator[Reading]:
    """Yield torques without what gravity needs, and robots that hang upside down."""
    names = _torque_columns(rows)
    if rows.weighs:
        yield replace(
            as_is,
            kind="no_gravity",
            text=f"{listed(names)} {_hold(names)} no gravity: the driver takes it out",
            prior=_EVERYWHERE,
            weight=0.0,
            columns=tuple(names),
        )
        yield replace(
            as_is,
            kind="upside_down",
            text="gravity acts the other way: the robot hangs upside down",
            prior=_SOMEWHERE,
            weight=-1.0,
        )


def _late(rows: LogRows, as_is: Reading, lag: float) -> Reading:
    """Return torques that are late. A low-pass is a delay for what is slower than it."""
    names = _torque_columns(rows)
    lag = float(f"{lag:.1g}")  # joints and logs differ in the next digit
    return replace(
        as_is,
        kind="torque_late",
        text=f"{listed(names)} lag by {1e3 * lag:.0f} ms: a delay, or a low-pass as long",
        prior=_SOMEWHERE,
        lag=lag,
        **_with({name: {"lag": lag} for name in names}),
    )


def _zeros(rows: LogRows, log: Log, as_is: Reading) -> Iterator[Reading]:
    """Yield positions whose zero is another one: off by a quarter or half a turn."""
    for i, joint in enumerate(rows.robot.single_joints):
        if slides(rows.robot, joint) or not rows.weighs:
            continue
        for degrees in (90, -90, 180):
            turn = degrees * pi / 180.0
            names = [n for n in encoder_columns(log, joint) if n.endswith("position")]
            yield replace(
                as_is,
                kind="position_zero",
                text=f"the zero of {joint}.position is off by {-degrees} degrees",
                prior=_RARE,
                offset=_put(np.zeros_like(as_is.factor), [i], 1.0, turn),
                # Behind the last joint of a chain, a link that is turned needs the same torque.
                told=len(rows.robot.model.subtrees[rows.robot.model.getJointId(joint)]) > 1,
                **_with({name: {"offset": turn} for name in names}),
            )


def _with(columns: Mapping[str, Mapping[str, object]]) -> dict[str, Any]:
    return {"mend": {"columns": columns}, "columns": tuple(columns)}


def _torque_columns(rows: LogRows) -> list[str]:
    joints = rows.robot.transmission.joints
    return [f"{joint}.{quantity}" for joint, quantity in zip(joints, rows.quantities, strict=True)]


def _all_or_one(count: int) -> list[list[int]]:
    return [list(range(count)), *([k] for k in range(count) if count > 1)]


def _put(
    values: FloatArray, places: Sequence[int], factor: float | FloatArray, added: float = 0.0
) -> FloatArray:
    changed = values.copy()
    changed[list(places)] = changed[list(places)] * factor + added
    return changed


def _exchanged(order: IntArray, a: int, b: int) -> IntArray:
    changed = order.copy()
    changed[[a, b]] = order[[b, a]]
    return changed


def _holds(names: Sequence[str]) -> str:
    return f"{listed(names)} {_hold(names)}"


def _hold(names: Sequence[str]) -> str:
    return "holds" if len(names) == 1 else "hold"


def listed(texts: Sequence[str]) -> str:
    """Return 'a, b and c', or 'a' where all texts are the same."""
    *first, last = texts
    if all(text == last for text in first):
        return last
    return f"{', '.join(first)} and {last}"


def encoder_columns(log: Log, joint: str) -> list[str]:
    """Return the columns of a joint that turn with its encoder."""
    return [name for q in ENCODER_UNITS if (name := f"{joint}.{q}") in log.columns]


class Bench:
    """Holds one log against its robot; each need and each report is computed once."""

    def __init__(self, rows: LogRows, share: float = 1.0) -> None:
        """Start with nothing computed.

        Args:
            rows: of the log.
            share: of its samples that count: a run that is repeated n times says the nth part.
        """
        self._rows = rows
        self._share = share
        self._inertia = _inertia(rows)
        self._needs: dict[bytes, Need] = {}
        self._reports: dict[bytes, Report] = {}
        self._unrelated: FloatArray | None = None

    def unrelated(self, reading: Reading) -> FloatArray:
        """Return (m,) the log likelihoods of the columns of a reading if they mean nothing."""
        if self._unrelated is None:
            plain = self.reports(as_it_stands(self._rows))
            self._unrelated = np.array([one.idle for one in plain])
        return self._unrelated[reading.torque_order]

    def reports(self, reading: Reading) -> tuple[Report, ...]:
        """Return the report of every driven joint, read in one way."""
        rows = self._rows
        place = reading.place
        if place not in self._needs:
            self._needs[place] = rows.need(
                reading.order, reading.factor, reading.weight, reading.offset
            )
        torque = reading.torque(rows)
        found = []
        for k in range(torque.shape[1]):
            key = place + torque[:, k].tobytes() + bytes([k])
            if key not in self._reports:
                samples = self._share * float(rows.samples[reading.torque_order[k]])
                self._reports[key] = report(
                    torque[:, k],
                    self._needs[place],
                    k,
                    samples,
                    float(self._inertia[k]),
                    float(rows.robot.transmission.reflected_inertia[k]),
                    0.0 if rows.quantities[k] == "motor_torque" else -1.0,
                )
            found.append(self._reports[key])
        return tuple(found)

    def strays(self, reading: Reading) -> FloatArray:
        """Return (parts, m) how far the reports stray from the need in thirds of the log.

        Power of the difference over the geometric mean of the powers of both: nothing is fitted, so
        no gain, friction or inertia can take the place of what the links need.
        """
        rows = self._rows
        self.reports(reading)
        need = self._needs[reading.place]
        whole = need.links + rows.robot.transmission.reflected_inertia * need.change
        torque = reading.torque(rows)
        size = np.sqrt(np.mean(torque**2, axis=0) * np.mean(whole**2, axis=0))
        parts = np.array_split((torque - whole) ** 2, _PARTS)
        powers = np.array([part.mean(axis=0) for part in parts])
        return np.asarray(powers / np.maximum(size, 1e-300))


def _inertia(rows: LogRows) -> FloatArray:
    """Return (m,) the typical inertia of each driven joint with its rotor."""
    robot = rows.robot
    data = robot.model.createData()
    places = rows.position[:: max(1, len(rows.position) // 8)]
    own = [np.diag(pin.crba(robot.model, data, q))[robot.actuated] for q in places]
    return np.asarray(np.mean(own, axis=0) + robot.transmission.reflected_inertia)
