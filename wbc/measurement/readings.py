"""The mistakes that people make with columns, each with how the log reads without it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import degrees, inf, pi
from math import log as ln
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.measurement.column_mistakes import COUNTS_OF_A_TURN, whole_counts
from wbc.measurement.evidence import Report, report
from wbc.measurement.findings import ENCODER_UNITS, Mend, in_degrees, listed
from wbc.measurement.lags_and_zeros import MOVED, ZERO_PRIOR
from wbc.measurement.log import Log
from wbc.measurement.log_rows import LogRows, Need
from wbc.measurement.schema import LOG_UNITS
from wbc.robot.coordinates import slides

# How often a set of logs has a mistake of a kind: a judgement, nobody counted. A factor 3 moves a
# decision by one nat; clear cases have ten or more.
_EVERYWHERE = ln(0.02)
_SOMEWHERE = ln(0.01)
_RARE = ln(0.003)
Lag: TypeAlias = tuple[Sequence[int], float]
Zero: TypeAlias = tuple[int, float]
_PARTS = 3  # of a log, in each of which a correction must bring the reports closer to the need

# How far turning joints travel in a log [rad]: 32 joints of seven recorded robots have a median of
# 1.8 and a standard deviation of the logarithm of 0.84. One in ten may be anything else.
_TRAVEL, _TRAVEL_SPREAD = 1.8, 0.84
_OTHER, _OTHER_SPREAD = 0.1, 1.5


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
        lag: (m,) by how much the torques are late [s], None for nothing.
        rivals: log prior of what is no mistake of a column and needs the same torque.
        exchanged: driven joints that have each other's columns.
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
    lag: FloatArray | None = None
    offset: FloatArray | None = None
    rivals: float = -inf
    exchanged: tuple[int, ...] = ()

    @property
    def place(self) -> bytes:
        """What the need of the links depends on."""
        zero = b"" if self.offset is None else self.offset.tobytes()
        return b"".join((self.order.tobytes(), self.factor.tobytes(), zero, b"%g" % self.weight))

    def torque(self, rows: LogRows) -> FloatArray:
        """Return the torque (N, m) at the motors' outputs that the log reports, read so."""
        factor = self.torque_factor * rows.conversion / rows.conversion[self.torque_order]
        torque = rows.torque if self.lag is None else rows.late(self.lag)
        return np.asarray(torque[:, self.torque_order] * factor)


def readings(
    rows: LogRows,
    log: Log,
    lost: BoolArray,
    doubtful: bool,
    lags: Sequence[Lag],
    zeros: Sequence[Zero],
) -> Iterator[Reading]:
    """Yield the log as it stands, and then every mistake with the reading that undoes it.

    Args:
        rows: of the log.
        log: names the columns.
        lost: (m,) driven joints whose report does not follow the need as the log stands; only
            theirs may be exchanged.
        doubtful: whether any report leaves more than physics usually does; only then gravity
            is asked about.
        lags: joints, by number, whose torques share a lag [s].
        zeros: single joints, by number, and what may have to be added to their positions [rad].
    """
    as_is = as_it_stands(rows)
    yield as_is
    yield from _signs(rows, log, as_is)
    yield from _units(rows, log, as_is)
    yield from _sides(rows, as_is)
    yield from _exchanges(rows, log, lost, as_is)
    yield from _late(rows, as_is, lags)
    yield from _zeros(rows, log, as_is, zeros)
    if doubtful:
        yield from _left_out(rows, as_is)


def as_it_stands(rows: LogRows) -> Reading:
    """Return the reading that changes nothing."""
    driven = rows.robot.transmission.size
    return Reading("", "", ln(0.8), *rows.as_read, np.arange(driven), np.ones(driven), {})


def _signs(rows: LogRows, log: Log, as_is: Reading) -> Iterator[Reading]:
    """Yield torques and positions whose sign is the other way round."""
    names = _torque_columns(rows)
    for k in _all_or_one(len(names)):
        chosen, many = [names[i] for i in k], len(k) > 1
        text = (
            f"the sign{'s' if many else ''} of {listed(chosen)} {'are' if many else 'is'} reversed"
        )
        prior = _EVERYWHERE if many else _SOMEWHERE
        yield _scaled(as_is, "torque_sign", text, prior, k, -1.0, {n: {"sign": -1} for n in chosen})
    for i, joint in enumerate(rows.robot.single_joints):
        yield replace(
            as_is,
            kind="position_sign",
            text=f"the sign of {joint}.position is reversed",
            prior=_SOMEWHERE,
            factor=_put(as_is.factor, [i], -1.0),
            **_with({name: {"sign": -1} for name in encoder_columns(log, joint)}),
        )


def _units(rows: LogRows, log: Log, as_is: Reading) -> Iterator[Reading]:
    """Yield torques and angles in other units."""
    names, driven = _torque_columns(rows), rows.robot.transmission.joints
    for k in _all_or_one(len(names)):
        chosen = [names[i] for i in k]
        kinds = {
            "mA" if names[i].endswith(".current") else "mN" if slides(rows.robot, driven[i]) else ""
            for i in k
        }
        prior = _EVERYWHERE if len(k) == len(names) else _RARE
        # A torque, a force and a current have no unit in common.
        units = ("N mm", "N cm") if kinds == {""} else tuple(kinds)
        for unit in units if len(kinds) == 1 else ():
            text, columns = f"{_holds(chosen)} {unit}", {name: {"unit": unit} for name in chosen}
            yield _scaled(as_is, "torque_unit", text, prior, k, LOG_UNITS[unit][1], columns)
    single = rows.robot.single_joints
    if counted := whole_counts(log):
        places = [i for i, joint in enumerate(single) if f"{joint}.position" in counted]
        for turn, worth in COUNTS_OF_A_TURN.items():
            yield replace(
                as_is,
                kind="counts",
                text=f"{_holds(counted)} counts of an encoder of {turn} a turn",
                prior=_EVERYWHERE - ln(len(COUNTS_OF_A_TURN)),
                factor=_put(as_is.factor, places, worth),
                **_with({name: {"scale": worth} for name in counted}),
            )
        return
    turning = [i for i, joint in enumerate(single) if not slides(rows.robot, joint)]
    for k in _all_or_one(len(turning)) if turning else []:
        places = [turning[i] for i in k]
        # One excitation moves all joints: their travels are one observation.
        travels = float(np.mean([_travels(log, single[i], pi / 180.0) for i in places]))
        yield replace(
            as_is,
            kind="degrees",
            text=f"{_holds([f'{single[i]}.position' for i in places])} degrees",
            prior=(_EVERYWHERE if len(k) == len(turning) else _RARE) + travels,
            factor=_put(as_is.factor, places, pi / 180.0),
            **_with(in_degrees(log.columns, [single[i] for i in places])["columns"]),
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
        chosen, quantity = listed([names[i] for i in k]), rows.quantities[k[0]]
        prior = _EVERYWHERE if len(k) == len(names) else _RARE
        for power in (1.0, -1.0):
            if (quantity, power) in (("rotor_torque", -1.0), ("motor_torque", 1.0)):
                side, when = ("motor", "after") if power < 0.0 else ("rotor", "before")
                text = f"the log gives torque {when} the reduction as {chosen}"
                factors = ratio[k] ** power
                entries = [{"side": side, "gear_ratio": float(ratio[i])} for i in k]
            else:
                text = f"the gear ratio was applied once too often to {chosen}"
                if quantity == "current":
                    text = (
                        f"the torque constants behind {chosen} belong to the other side of the gear"
                    )
                factors = np.abs(ratio[k]) ** power
                entries = [{"scale": float(factor)} for factor in factors]
            columns = {names[i]: entry for i, entry in zip(k, entries, strict=True)}
            yield _scaled(as_is, "gear_side", text, prior, k, factors, columns)


def _exchanges(rows: LogRows, log: Log, lost: BoolArray, as_is: Reading) -> Iterator[Reading]:
    """Yield pairs of joints whose columns are exchanged."""
    driven, single = rows.robot.transmission.joints, list(rows.robot.single_joints)
    names = _torque_columns(rows)
    for a, b in combinations(map(int, np.flatnonzero(lost)), 2):
        both = ((driven[a], driven[b]), (driven[b], driven[a]))
        moved = {
            f"{one}.{name.removeprefix(other + '.')}": {"from": name}
            for one, other in both
            for name in encoder_columns(log, other)
        }
        crossed = {names[a]: {"from": names[b]}, names[b]: {"from": names[a]}}
        order = _exchanged(as_is.order, single.index(driven[a]), single.index(driven[b]))
        torque_order = _exchanged(as_is.torque_order, a, b)
        ways = [("positions", order, as_is.torque_order, moved)]
        if rows.quantities[a] == rows.quantities[b]:
            ways += [
                ("torques", as_is.order, torque_order, crossed),
                ("positions and torques", order, torque_order, {**moved, **crossed}),
            ]
        for what, places, torques, columns in ways:
            yield replace(
                as_is,
                kind="exchanged",
                text=f"the {what} of {driven[a]} and {driven[b]} are exchanged",
                prior=_RARE,
                order=places,
                torque_order=torques,
                exchanged=(a, b),
                **_with(columns),
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


def _late(rows: LogRows, as_is: Reading, lags: Sequence[Lag]) -> Iterator[Reading]:
    """Yield torques that are late. A low-pass is a delay for what is slower than it."""
    names = _torque_columns(rows)
    for joints, lag in lags:
        lag = float(f"{lag:.1g}")  # joints and logs differ in the next digit
        late = [names[k] for k in joints]
        yield replace(
            as_is,
            kind="torque_late",
            text=f"{listed(late)} {'lags' if len(late) == 1 else 'lag'} by {1e3 * lag:.0f} ms: "
            "a delay, or a low-pass as long",
            prior=_SOMEWHERE,
            lag=_put(np.zeros(len(names)), joints, 1.0, lag),
            **_with({name: {"lag": lag} for name in late}),
        )


def _zeros(rows: LogRows, log: Log, as_is: Reading, zeros: Sequence[Zero]) -> Iterator[Reading]:
    """Yield positions whose zero is another one."""
    model = rows.robot.model
    for i, turn in zeros:
        joint = rows.robot.single_joints[i]
        # Behind the last joint of a chain, a link that is turned needs the same torque.
        last = len(model.subtrees[model.getJointId(joint)]) == 1
        names = [n for n in encoder_columns(log, joint) if n.endswith("position")]
        prior = MOVED + float(ZERO_PRIOR[round(degrees(turn)) % 360])
        yield replace(
            as_is,
            kind="position_zero",
            text=f"the zero of {joint}.position is off by {degrees(-turn):.0f} degrees",
            prior=prior,
            offset=_put(np.zeros_like(as_is.factor), [i], 1.0, turn),
            rivals=prior - ln(3.0) if last else -inf,
            **_with({name: {"offset": turn} for name in names}),
        )


def _scaled(
    as_is: Reading,
    kind: str,
    text: str,
    prior: float,
    joints: Sequence[int],
    factor: float | FloatArray,
    columns: Mapping[str, Mapping[str, object]],
) -> Reading:
    """Return a reading of torques that are multiplied."""
    changed = _put(as_is.torque_factor, joints, factor)
    return replace(
        as_is, kind=kind, text=text, prior=prior, torque_factor=changed, **_with(columns)
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
        self._idle: dict[int, float] = {}
        self.reports(as_it_stands(rows))

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
        for k, source in enumerate(reading.torque_order):
            key = place + torque[:, k].tobytes() + bytes([k])
            if key not in self._reports:
                told = report(
                    torque[:, k],
                    self._needs[place],
                    k,
                    self._share * float(rows.samples[source]),
                    float(self._inertia[k]),
                    float(rows.robot.transmission.reflected_inertia[k]),
                    0.0 if rows.quantities[k] == "motor_torque" else -1.0,
                )
                # What means nothing does so however it is read.
                idle = self._idle.setdefault(int(source), told.idle)
                self._reports[key] = told._replace(idle=idle)
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
