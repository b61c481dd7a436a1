"""The residual of a robot on a set of records: what the model does not explain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics.batch import motor_torque, output_torque
from wbc.errors import DynamicsError, EffectError, TransmissionError
from wbc.identification.model.yielding import LinkSide, LinkSwing, deflects, some_deflect, swing
from wbc.identification.records.record import Record, output_count
from wbc.links import Deflections, LinkResponse
from wbc.robot import Effect, Motion, Parameter, Robot

_STEP = 1e-7  # of the largest load, by which loads are varied
_SQUEEZES = 3  # rounds in which internal forces and the gears' direction of power settle
_LEAST_GAIN = 0.2  # a drive model may not shrink the torque it is compared with below this share

# What is unexplained at the rotors (N, m), at the base (N, b), at torque sensors (N, s).
_Rows = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Asked:
    """What a motion asks of a robot's gears: nothing of it depends on meshes, rotors and drives.

    Attributes:
        motion: the true one.
        links: (N, nv) what the links need.
        contacts: (N, nv) what the contacts give.
        output: (N, m) torque at the outputs of the gears.
        wrench: (N, b) torque that no motor gives.
    """

    motion: Motion
    links: FloatArray
    contacts: FloatArray
    output: FloatArray
    wrench: FloatArray

    @classmethod
    def of(cls, robot: Robot, motion: Motion, links: FloatArray, contacts: FloatArray) -> Asked:
        """Return what is asked where links and contacts are known: joints rub as effects say."""
        asked = output_torque(_without_drives(robot), motion, links, contacts)
        return cls(motion, links, contacts, *asked)


def asked_of_gears(
    robot: Robot, record: Record, swinging: FloatArray | None = None
) -> Asked | None:
    """Return what a record asks of the gears; None where the gears say how contacts press.

    Arguments as those of `raw_residual`.
    """
    return Asked.of(robot, *_loads(robot, record, swinging)) if record.balance is None else None


def raw_residual(
    robot: Robot, record: Record, swinging: FloatArray | None = None, asked: Asked | None = None
) -> FloatArray:
    """Return (N, m + b + s) measured minus modelled, before weights and filters.

    The m driven joints come first (torque at the motor output, reported minus needed), then the b
    undriven coordinates (minus the wrench that nothing provides), and the s torque sensors behind
    gears (measured minus what the links need); see `records.outputs`.

    Reported torque goes through the robot's drives forward, so that a drive that clips, sags or
    lags needs no inverse; the result is divided by the drive's slope, so that it stands in the
    torque that is reported, or else a factor that shrinks everything would explain everything.

    Args:
        robot: with its effects.
        record: one log.
        swinging: torque of a `swing_of`, for a robot that differs little; None has links
            behind soft gears simulated again.
        asked: of the gears, if known; then nothing is computed of the links.
    """
    if asked is not None:
        delivered, slope = _delivered(robot, asked.motion, record.torque)
        rows = _rows_of_gears(robot, record, asked, delivered)
        return _in_one(robot, rows, slope)
    motion, links, contacts = _loads(robot, record, swinging)
    return _unexplained(robot, record, motion, links, contacts)


def swing_of(
    robot: Robot, record: Record, near: Deflections | None = None, *, straight: bool = False
) -> LinkSwing | None:
    """Return how links swing behind their gears, None if none does.

    Args:
        robot: with its effects.
        record: one log.
        near: how they move with numbers close by.
        straight: as in `swing`.
    """
    if not some_deflect(robot.effects):
        return None
    motion, links, contacts = _loads(robot, record, np.zeros_like(record.links))
    return _swinging(robot, record, motion, links, contacts, near, straight)


def _loads(
    robot: Robot, record: Record, swinging: FloatArray | None
) -> tuple[Motion, FloatArray, FloatArray]:
    """Return the true motion, what the links then need, and what the contacts give."""
    motion = record.motion_of(robot)
    moved = record.along(motion)
    links, contacts = moved.links_of(robot), moved.contacts_of(robot)
    if swinging is None and some_deflect(robot.effects):
        swinging = _swinging(robot, record, motion, links, contacts).torque
    if swinging is not None:
        links = links + swinging
    return motion, links, contacts


def by_link_torque(
    robot: Robot, record: Record, swinging: FloatArray | None
) -> tuple[FloatArray, Record]:
    """Return (N, m + b, nv) the change of the residual with what the links need.

    With it the record along the true motion, whose regressor says how that changes. Gears that
    lose a share of the load make the change depend on its direction.

    Args:
        robot: with its effects.
        record: one log.
        swinging: torque of `swing_of`.
    """
    motion, links, contacts = _loads(robot, record, np.zeros_like(record.links))
    links = links if swinging is None else links + swinging
    moved = record.along(motion)
    if record.balance is None:
        return _slopes_of_gears(robot, moved, links, contacts), moved
    before = _unexplained(robot, record, motion, links, contacts)
    step = _STEP * max(float(np.max(np.abs(links))), 1.0)
    slopes = [
        (_unexplained(robot, record, motion, links + step * unit, contacts) - before) / step
        for unit in np.eye(links.shape[1])
    ]
    return np.stack(slopes, axis=-1), moved


def _slopes_of_gears(
    robot: Robot, moved: Record, links: FloatArray, contacts: FloatArray
) -> FloatArray:
    """Return `by_link_torque` where all contact forces are known: each gear feels its output."""
    gears = robot.transmission
    plain = _without_drives(robot)
    output, _ = output_torque(plain, moved.motion, links, contacts)
    result = np.zeros((len(links), output_count(robot), links.shape[1]))
    driven = result[:, : gears.size]
    driven[..., robot.actuated] = -gears.topology.T * np.sign(gears.gear_ratio)[:, None]
    driven *= _mesh_slope(plain, moved.motion, _carried(moved, output))[..., None]
    _, slope = _delivered(robot, moved.motion, moved.torque)
    driven /= np.maximum(slope, _LEAST_GAIN)[:, None]
    driven[:, robot.sensed] = 0.0  # they start from what the sensors measure
    base = gears.size + np.arange(robot.floating_size)
    result[:, base, robot.unactuated] = -1.0
    behind = result[:, gears.size + robot.floating_size :]
    behind[..., robot.actuated] = -gears.topology.T[robot.sensed]
    return result


def link_response(robot: Robot, record: Record, joint: str) -> LinkResponse:
    """Return how the link behind a gear of `robot` reacts, and what of the log it may explain."""
    motion, links, contacts = _loads(robot, record, None)
    left = _on_joints(robot, _unexplained(robot, record, motion, links, contacts))
    response = record.along(motion).response_of(robot, joint)
    return replace(response, load=links - contacts, unexplained=left[:, response.row])


def rubbing_response(robot: Robot, record: Record, joint: str) -> LinkResponse | None:
    """Return the response of a link at which the friction of `robot` rubs.

    None where there is no friction, or where a gear that yields already has it on its side.
    """
    gears = [effect for effect in robot.effects if deflects(effect) and effect.where == joint]
    side = None if gears else LinkSide.of(robot, joint, record.motion)
    if side is None:
        return None
    response = link_response(robot, record, joint)
    load = np.array(response.load)
    load[:, side.row] += side.motor.smooth
    return side.on(replace(response, load=load))


def _swinging(
    robot: Robot,
    record: Record,
    motion: Motion,
    links: FloatArray,
    contacts: FloatArray,
    near: Deflections | None = None,
    straight: bool = False,
) -> LinkSwing:
    def unexplained(more: FloatArray) -> FloatArray:
        return _on_joints(robot, _unexplained(robot, record, motion, links + more, contacts))

    return swing(robot, record.along(motion), unexplained, near, straight=straight)


def _on_joints(robot: Robot, residual: FloatArray) -> FloatArray:
    """Return the residual of the driven joints (N, nv), as torque on the links' side."""
    gears = robot.transmission
    output = residual[:, : gears.size] * np.sign(gears.gear_ratio)
    return np.asarray(output @ robot.motor_rows)


def _unexplained(
    robot: Robot, record: Record, motion: Motion, links: FloatArray, contacts: FloatArray
) -> FloatArray:
    delivered, slope = _delivered(robot, motion, record.torque)
    rows = _rows(robot, record.along(motion), links, contacts, delivered)
    return _in_one(robot, rows, slope)


def _in_one(robot: Robot, rows: _Rows, slope: FloatArray) -> FloatArray:
    """Return (N, m + b + s): those of the gears at their outputs, in reported torque."""
    gears, base, sensors = rows
    driven = gears * (np.abs(robot.transmission.gear_ratio) / np.maximum(slope, _LEAST_GAIN))
    return np.concatenate([driven, base, sensors], axis=1)


def _rows_of_gears(robot: Robot, moved: Record, asked: Asked, delivered: FloatArray) -> _Rows:
    """Return `_rows` where all contact forces are known."""
    carried = _carried(moved, asked.output)
    gears = delivered - motor_torque(_without_drives(robot), asked.motion, carried)
    return gears, -asked.wrench, moved.sensed - asked.output[:, robot.sensed]


def _rows(
    robot: Robot, moved: Record, links: FloatArray, contacts: FloatArray, delivered: FloatArray
) -> _Rows:
    """Return what is unexplained at the rotors (N, m), at the base (N, b), at sensors (N, s).

    Contact forces that were not measured are those that leave least: first of the base's balance,
    then, where contacts press against each other, at the gears' outputs.
    """
    plain = _without_drives(robot)
    output, wrench = output_torque(plain, moved.motion, links, contacts)
    balance = moved.balance
    if balance is not None:
        contacts = contacts + balance.carried(wrench)
        output, wrench = output_torque(plain, moved.motion, links, contacts)
    if balance is None or balance.inner is None:
        asked = Asked(moved.motion, links, contacts, output, wrench)
        return _rows_of_gears(robot, moved, asked, delivered)
    ratio = robot.transmission.gear_ratio
    left, slope = np.zeros_like(output), np.ones_like(output)
    for last in (*(False,) * _SQUEEZES, True):
        carried = _carried(moved, output)
        gears = delivered - motor_torque(plain, moved.motion, carried)
        slope = slope if last else _mesh_slope(plain, moved.motion, carried)
        left = gears * ratio / slope  # at the outputs of the gears
        left[:, robot.sensed] = moved.sensed - output[:, robot.sensed]
        if not last:
            contacts = contacts - balance.squeezed(left)
            output, wrench = output_torque(plain, moved.motion, links, contacts)
    left = balance.seen(left)
    free = slope * left / ratio
    free[:, robot.sensed] = gears[:, robot.sensed]  # these know nothing of the contacts
    return free, -wrench, left[:, robot.sensed]


def _carried(moved: Record, output: FloatArray) -> FloatArray:
    """Return what the gears give (N, m): as the sensors behind them say, else as links need."""
    if not moved.robot.sensed.size:
        return output
    result = np.array(output)
    result[:, moved.robot.sensed] = moved.sensed
    return result


def _mesh_slope(robot: Robot, motion: Motion, output: FloatArray) -> FloatArray:
    """Return (N, m) how much the motors must give per torque at the outputs of their gears."""
    gears = robot.transmission
    if all(np.all(eta == 1.0) for eta in robot.gear_efficiencies(motion)):
        return np.ones_like(output)
    step = _STEP * max(float(np.max(np.abs(output))), 1.0)
    more = motor_torque(robot, motion, output + step) - motor_torque(robot, motion, output)
    return np.asarray(more * gears.gear_ratio / step)


def condensed_residual(robot: Robot, records: Sequence[Record]) -> FloatArray:
    """Return weighted, low-passed and thinned residuals of all records, (rows, m + b)."""
    return np.concatenate([record.condense(raw_residual(robot, record)) for record in records])


def drive_gains(robot: Robot, records: Sequence[Record]) -> FloatArray:
    """Return (m,) the share of the reported torque that the drives of `robot` deliver."""
    return np.asarray(np.mean([_delivered(robot, r.motion, r.torque)[1] for r in records], axis=0))


def passed_on(
    robot: Robot, record: Record, need: FloatArray, noise: FloatArray, other: FloatArray
) -> FloatArray:
    """Return by how much two noises (N, m) of reported torques differ behind the drives.

    Noises and result at the motor outputs. A drive that clips its torque passes no noise on while
    it does: where what the motion needs, with the noise, is beyond the limit. A report will not do
    in place of the need (N, m): it is beyond the limit most where its noise is large.
    """
    ratio = np.abs(robot.transmission.gear_ratio)
    one, slope = _delivered(robot, record.motion, need + noise / ratio)
    two, _ = _delivered(robot, record.motion, need + other / ratio)
    return np.asarray((one - two) * (ratio / np.maximum(slope, _LEAST_GAIN)))


def torque_of_drives(robot: Robot, record: Record) -> tuple[FloatArray, FloatArray]:
    """Return the torque (N, m) on the rotors that drives deliver, and what the motion needs."""
    motion, links, contacts = _loads(robot, record, None)
    delivered, _ = _delivered(robot, motion, record.torque)
    lacking, _, _ = _rows(robot, record.along(motion), links, contacts, delivered)
    return delivered, delivered - lacking


_LARGER = 1.01  # times a report, by which it is tried whether its size matters: any factor does


def beyond_limits(robot: Robot, record: Record) -> FloatArray:
    """Return (N, m + b + s) the torque in reports whose size changes nothing that is delivered.

    At the motor outputs. A limit predicts of such a report only that it is beyond. On a bare motor,
    whose reports were friction, a limit of 0.001 N m left 0.0048 N m of 0.0715.
    """
    asked = record.torque, _LARGER * record.torque
    given, more = (_delivered(robot, record.motion, torque)[0] for torque in asked)
    beyond = np.zeros((len(given), output_count(robot)))
    # Where nothing is delivered, such as zeros that come late, no limit was reached.
    clipped = (more == given) & (given != 0.0)
    own = np.where(clipped, record.torque - given, 0.0)
    beyond[:, : own.shape[1]] = own * robot.transmission.gear_ratio
    return beyond


def drive_misses(robot: Robot, records: Sequence[Record]) -> FloatArray:
    """Return (m,) rms of delivered minus needed torque, as a share of the needed torque's."""
    missing, needed = [], []
    size = robot.transmission.size
    for record in records:
        delivered, need = torque_of_drives(robot, record)
        nothing = np.zeros((len(need), output_count(robot) - size))
        missing.append(record.condense(np.concatenate([delivered - need, nothing], axis=1)))
        needed.append(record.condense(np.concatenate([need, nothing], axis=1)))
    left, right = (np.mean(np.concatenate(p)[:, :size] ** 2, axis=0) for p in (missing, needed))
    return np.asarray(np.sqrt(left / np.maximum(right, 1e-300)))


def _without_drives(robot: Robot) -> Robot:
    kept = tuple(e for e in robot.effects if "drive" not in e.acts_by)
    return robot if len(kept) == len(robot.effects) else robot.with_acting(kept)


def _delivered(robot: Robot, motion: Motion, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
    drives = [effect for effect in robot.effects if "drive" in effect.acts_by]
    slope = np.ones(torque.shape[1])
    delivered = torque
    joints = robot.transmission.joints
    for effect in drives:
        before = delivered
        delivered = effect.drive(robot, motion, before)
        own = [joints.index(effect.where)] if effect.where in joints else range(len(joints))
        for k in own:  # an effect at a joint leaves all other drives as they are
            power = float(before[:, k] @ before[:, k])
            if power > 0.0:
                slope[k] *= float(before[:, k] @ delivered[:, k]) / power
    return delivered, slope


IMPOSSIBLE = (EffectError, TransmissionError, DynamicsError)
"""Raised where a robot cannot have an effect with these parameters."""

Slots = Sequence[tuple[int, Parameter]]
"""Parameters as (number of effect, parameter)."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What effects with these parameters leave.

    Attributes:
        effects: added to the robot.
        robot: with the effects.
        records: the logs.
        raw: per record, what is left (N, m + b) before weights and filters [N m, N].
        residual: (rows, outputs), whitened.
        swings: per record, how links swing behind their gears, or None.
        asked: per record, what the motion asks of the gears, or None.
    """

    effects: tuple[Effect, ...]
    robot: Robot
    records: tuple[Record, ...]
    raw: tuple[FloatArray, ...]
    residual: FloatArray
    swings: tuple[LinkSwing | None, ...]
    asked: tuple[Asked | None, ...]

    @property
    def swinging(self) -> tuple[FloatArray | None, ...]:
        """Per record (N, nv), what links that swing behind their gears need more, or None."""
        return torques_of(self.swings)

    @property
    def cost(self) -> float:
        """Sum of squares."""
        return float(np.sum(self.residual**2))


def evaluate(
    robot: Robot,
    effects: Sequence[Effect],
    records: Sequence[Record],
    whitening: FloatArray,
    near: Evaluation | None = None,
) -> Evaluation:
    """Return what `robot` with `effects` leaves; links that swing are simulated once.

    Args:
        robot: that lacks the effects.
        effects: to add.
        records: the logs.
        whitening: (outputs, judged outputs) by which residuals are multiplied.
        near: the same effects with numbers close by.

    Raises:
        DynamicsError: a link flies off behind its gear, or an effect gives what is not finite.
    """
    whole = robot.with_effects(*effects)
    swings = swings_of(whole, records, near)
    swinging = torques_of(swings)
    pairs = list(zip(records, swinging, strict=True))
    asked = tuple(asked_of_gears(whole, record, held) for record, held in pairs)
    known = zip(pairs, asked, strict=True)
    raw = tuple(raw_residual(whole, record, held, of) for (record, held), of in known)
    condensed = [record.condense(left) for record, left in zip(records, raw, strict=True)]
    residual = np.concatenate(condensed)
    if not np.isfinite(residual).all():
        names = ", ".join(f"{effect.name} at '{effect.where}'" for effect in effects)
        raise DynamicsError(f"'{robot.name}' with {names} needs torque that is not finite.")
    return Evaluation(
        tuple(effects), whole, tuple(records), raw, residual @ whitening, swings, asked
    )


def swings_of(
    robot: Robot, records: Sequence[Record], near: Evaluation | None, *, straight: bool = False
) -> tuple[LinkSwing | None, ...]:
    """Return per record how links swing behind their gears, or None; see `swing_of`."""
    known = [None] * len(records) if near is None else near.swings
    bents = [None if swing is None else swing.bent for swing in known]
    pairs = zip(records, bents, strict=True)
    return tuple(swing_of(robot, record, bent, straight=straight) for record, bent in pairs)


def torques_of(swings: Sequence[LinkSwing | None]) -> tuple[FloatArray | None, ...]:
    """Return per record (N, nv) what links that swing need more, or None."""
    return tuple(None if swing is None else swing.torque for swing in swings)


def with_changes(
    effects: Sequence[Effect], changes: Mapping[tuple[int, str], float], *, clip: bool = False
) -> list[Effect]:
    """Return the effects with changed parameters.

    Args:
        effects: as they are.
        changes: (number of effect, name of parameter) -> what is added to its value.
        clip: stop at the parameter's bounds.

    Raises:
        EffectError: a value that the effect cannot have.
    """
    result, each = list(effects), dict[int, dict[str, float]]()
    for (k, name), change in changes.items():
        each.setdefault(k, {})[name] = result[k].values[name] + change
    for k, values in each.items():
        if clip:
            bounds = {p.name: p for p in result[k].parameters}
            values = {n: min(max(v, bounds[n].low), bounds[n].high) for n, v in values.items()}
        result[k] = result[k].with_values(values)
    return result
