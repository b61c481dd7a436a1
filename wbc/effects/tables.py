"""The effects of a robot as numbers for compiled loops, and what of them is left for hooks.

Effects that are a law of a joint's position and speed, or a factor, limit or offset of a drive,
are rows of a table. Their laws stand in their own files, as functions of numbers or arrays: the
hooks call them as they stand, and here they are compiled. Whoever simulates or controls a robot
makes its table once and hands the arrays to the functions below; they take no Python objects and
may be called from compiled functions:

    table = effect_table(robot)
    fill_torques(table.joints, table.numbers, q, v, smooth, dry)
    fill_delivered(table.drives, command, rotor)    # a simulator: what the drives give
    fill_commands(table.drives, rotor, command)     # a controller: what to ask them for
    fill_efficiencies(table.gears, speed, forward, backward, now_forward, now_backward)

What is left acts by its hooks, `left_for_hooks(robot)`: one effect per kind, with all its places.
Their smooth torques and levels add to the table's. A command goes through their `drive` hooks in
order, then through `fill_delivered`, then their `rotor_torque` is added; the way back is the
reverse.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import fields
from itertools import filterfalse
from typing import Any, NamedTuple

import numpy as np

from wbc.arrays import FloatArray, IntArray, frozen
from wbc.compiled import Dense, Number, OutRow, Row, Table, compiled
from wbc.effects import friction
from wbc.effects.catalogue import EFFECTS
from wbc.effects.drive import CurrentLimit, TorqueConstant, TorqueOffset
from wbc.effects.joint_effect import JointEffect, Rows
from wbc.effects.position_torques import JointSpring, TorqueRipple, ripple, spring
from wbc.robot import Effect, Motion, Robot
from wbc.transmission import stribeck

LAW, POSITION, VELOCITY = range(3)
"""Columns of `EffectTable.joints`."""
GAIN, LIMIT, OFFSET = range(3)
"""Columns of `EffectTable.drives`."""
COEFFICIENT, SPEED = range(2)
"""Columns of `EffectTable.gears`."""

VISCOUS, DIRECTIONAL, QUADRATIC, SPRING, RIPPLE, COULOMB, STRIBECK = range(7)
"""Laws."""

_LAWS: dict[type[Effect], int] = {
    friction.ViscousFriction: VISCOUS,
    friction.DirectionalViscousFriction: DIRECTIONAL,
    friction.QuadraticDrag: QUADRATIC,
    JointSpring: SPRING,
    TorqueRipple: RIPPLE,
    friction.CoulombFriction: COULOMB,
    friction.StribeckFriction: STRIBECK,
}
_NUMBERS = 3


class EffectTable(NamedTuple):
    """The effects of a robot that compiled loops evaluate; arrays that nobody may write.

    Attributes:
        joints: (k, 3) law, entry of q and row of v of each effect at a joint.
        numbers: (k, 3) its parameters in their order, zeros behind them.
        drives: (m, 3) factor of the commanded torque, limit of what comes out [N m], and what is
            added to it [N m], all on the rotor; 1, infinity and 0 where nothing acts.
        gears: (m, 2) share of the load lost near rest, and speed [rad/s] of the output at which it
            falls off: `slow_loss` and `slow_speed` of the transmission.
    """

    joints: IntArray
    numbers: FloatArray
    drives: FloatArray
    gears: FloatArray


_PERFECT = frozen([1.0, np.inf, 0.0])


def effect_table(robot: Robot) -> EffectTable:
    """Return the effects of `robot` that compiled loops evaluate."""
    joints, numbers, gears = [], [], robot.transmission
    drives = np.tile(_PERFECT, (gears.size, 1))
    for effect in filter(_tabled(robot), robot.effects):
        values = list(effect.values.values())
        if type(effect) in _LAWS:
            at = robot.position_index(effect.where), robot.velocity_index(effect.where)
            joints.append((_LAWS[type(effect)], *at))
            numbers.append(values + [0.0] * (_NUMBERS - len(values)))
            continue
        gear = gears.index(effect.where)
        ratio = float(gears.gear_ratio[gear])
        if isinstance(effect, TorqueConstant):  # acts on what the effects before it let through
            drives[gear, [GAIN, LIMIT]] *= effect.factor
        elif isinstance(effect, CurrentLimit):
            drives[gear, LIMIT] = min(drives[gear, LIMIT], effect.limit / abs(ratio))
        elif isinstance(effect, TorqueOffset):
            drives[gear, OFFSET] += effect.offset / ratio
    return EffectTable(
        frozen(np.reshape(joints, (-1, 3)), np.int64),
        frozen(np.reshape(numbers, (-1, _NUMBERS))),
        frozen(drives),
        frozen(np.column_stack((gears.slow_loss, gears.slow_speed))),
    )


def left_for_hooks(robot: Robot) -> tuple[Effect, ...]:
    """Return the effects of `robot` that no table holds, in order, all places of a kind as one.

    What only changes a number of the robot is not among them. An effect with several places has
    arrays (k,) as parameters. A user's kind whose hooks do not take them, or that has a memory,
    stays one effect per place.
    """
    groups: dict[object, list[Effect]] = {}
    for effect in filterfalse(_tabled(robot), robot.effects):
        if effect.acts_by - {"change"}:
            groups.setdefault(_kind(effect), []).append(effect)
    return tuple(effect for group in groups.values() for effect in _joined(robot, group))


def _tabled(robot: Robot) -> Callable[[Effect], bool]:
    """Return what says whether the table of a robot holds one of its effects.

    The drives of a robot act one after the other: all of them are in the table, or none.
    """
    kinds, drives = {*_LAWS, TorqueOffset}, {TorqueConstant, CurrentLimit}
    if {type(e) for e in robot.effects if e.acts_by & {"drive", "drive_inverse"}} <= drives:
        kinds |= drives
    return lambda effect: type(effect) in kinds


def _kind(effect: Effect) -> object:
    """Return what effects have in common that become one, if their hooks take arrays."""
    known = {"where", *(parameter.name for parameter in effect.parameters)}
    rest = {f.name: getattr(effect, f.name) for f in fields(effect) if f.name not in known}
    plain = all(isinstance(value, (str, bool, int, float)) for value in rest.values())
    remembers = type(effect).first_memory is not Effect.first_memory
    shipped = type(effect) in EFFECTS.values()
    alone = not isinstance(effect, JointEffect) or (remembers and not shipped)
    if alone or not plain or effect.parameters is not type(effect).parameters:
        return id(effect)
    return type(effect), tuple(rest.items())


def _joined(robot: Robot, effects: Sequence[Effect]) -> Sequence[Effect]:
    """Return effects of one kind as one effect, or as they are where their hooks take no arrays."""
    first = effects[0]
    if len(effects) == 1 or not isinstance(first, JointEffect):
        return effects
    joints = [effect.where for effect in effects]
    driven = robot.transmission.joints
    gears = [driven.index(joint) if joint in driven else -1 for joint in joints]
    places = map(robot.position_index, joints), map(robot.velocity_index, joints), gears
    rows = Rows(*(np.array(list(own)) for own in places))
    if len(set(joints)) < len(joints) or (first.needs_drive and np.any(rows.gear < 0)):
        return effects
    one = copy.copy(first)
    vars(one).pop("values", None)  # of the first place, kept since it was checked
    values = {p.name: np.array([getattr(e, p.name) for e in effects]) for p in first.parameters}
    for name, value in {"where": ", ".join(joints), "rows": rows, **values}.items():
        object.__setattr__(one, name, value)
    return (one,) if type(first) in EFFECTS.values() or _acts_like(robot, one, effects) else effects


def _acts_like(robot: Robot, one: Effect, effects: Sequence[Effect]) -> bool:
    """Whether one effect with several places does what the effects at these places do.

    A user's hook may be written for one number. It is asked for single samples from rest to fast
    motion, and for several samples at once.
    """
    random = np.random.default_rng(0)
    q, v = random.normal(size=(6, robot.model.nq)), random.normal(size=(6, robot.model.nv))
    v *= np.array([0.0, 1e-3, 0.1, 1.0, 10.0, 100.0])[:, None]
    motions = [*map(Motion, q, v), Motion(q, v)]
    try:
        both = [(_acted(robot, [one], m), _acted(robot, effects, m)) for m in motions]
        return all(np.allclose(got, wanted, rtol=1e-9, atol=1e-12) for got, wanted in both)
    except Exception:  # whatever a user's code says of numbers that it does not expect
        return False


def add_torques(
    robot: Robot, effect: Effect, motion: Motion, totals: tuple[FloatArray, FloatArray, FloatArray]
) -> None:
    """Add what an effect exerts to totals.

    They are smooth torque and level of dry friction (..., nv), and torque on the rotors (..., m).
    """
    hooks = effect.joint_torque, effect.joint_friction, effect.rotor_torque
    for total, hook in zip(totals, hooks, strict=True):
        found = hook(robot, motion)
        if found is not None:
            total += found


def _acted(robot: Robot, effects: Sequence[Effect], motion: Motion) -> FloatArray:
    """Return what effects do with a motion, by all hooks that a step or a tick calls."""
    samples, size = motion.velocity.shape[:-1], robot.transmission.size
    given = np.broadcast_to(np.linspace(-1.0, 1.0, size), (*samples, size))
    totals = (*np.zeros((2, *motion.velocity.shape)), np.zeros(given.shape))
    torque, command, shown, seen = given, given, motion, motion
    for effect in effects:
        add_torques(robot, effect, motion, totals)
        torque = effect.drive(robot, motion, torque)
        shown, seen = effect.measured(robot, shown), effect.true(robot, seen)
    for effect in reversed(effects):
        command = effect.drive_inverse(robot, motion, command)
    return np.concatenate((*totals, torque, command, shown.position, seen.position), axis=-1)


_viscous = compiled(Number, Number, Number)(friction.viscous)
_directional = compiled(Number, Number, Number, Number)(friction.directional)
_quadratic = compiled(Number, Number, Number)(friction.quadratic)
_spring = compiled(Number, Number, Number, Number)(spring)
_ripple = compiled(Number, Number, Number, Number, Number)(ripple)
near_rest: Any = compiled(Number, Number, Number, Number)(stribeck)


@compiled(counted=False)
def fill_torques(
    joints: Table, numbers: Dense, position: Row, velocity: Row, smooth: OutRow, dry: OutRow
) -> None:
    """Write what effects at joints do: smooth torque, and level >= 0 of dry friction, (nv,) [N m].

    The friction torque is -dry sgn(v), anything between at v = 0. `joints` and `numbers` are of the
    `EffectTable`, q (nq,) and v (nv,) of the robot.
    """
    smooth[:] = 0.0
    dry[:] = 0.0
    for i in range(len(joints)):
        law, row = joints[i, LAW], joints[i, VELOCITY]
        a, b, c = numbers[i, 0], numbers[i, 1], numbers[i, 2]
        q, v = position[joints[i, POSITION]], velocity[row]
        if law == VISCOUS:
            smooth[row] += _viscous(v, a)
        elif law == COULOMB:
            dry[row] += a
        elif law == STRIBECK:
            dry[row] += near_rest(v, a, b)
        elif law == DIRECTIONAL:
            smooth[row] += _directional(v, a, b)
        elif law == QUADRATIC:
            smooth[row] += _quadratic(v, a)
        elif law == SPRING:
            smooth[row] += _spring(q, a, b)
        elif law == RIPPLE:
            smooth[row] += _ripple(q, a, b, c)


@compiled(counted=False)
def fill_delivered(drives: Dense, command: Row, rotor: OutRow) -> None:
    """Write the torque on the rotors (m,) [N m] that the drives give for a command (m,)."""
    for i in range(len(drives)):
        limit = drives[i, LIMIT]
        given = min(max(drives[i, GAIN] * command[i], -limit), limit)
        rotor[i] = given + drives[i, OFFSET]


@compiled(counted=False)
def fill_commands(drives: Dense, rotor: Row, command: OutRow) -> None:
    """Write what to command (m,) so that drives within their limits put `rotor` (m,) [N m] on."""
    for i in range(len(drives)):
        command[i] = (rotor[i] - drives[i, OFFSET]) / drives[i, GAIN]


@compiled(counted=False)
def fill_efficiencies(
    gears: Dense, speed: Row, forward: Row, backward: Row, now_forward: OutRow, now_backward: OutRow
) -> None:
    """Write eta_f and eta_b (m,) at the speeds psi_dot (m,) [rad/s] of the gears' outputs.

    `gears` are of the `EffectTable`, `forward` and `backward` of the transmission.
    """
    for i in range(len(gears)):
        share = near_rest(speed[i], gears[i, COEFFICIENT], gears[i, SPEED])
        now_forward[i] = forward[i] * (1.0 - share)
        now_backward[i] = backward[i] / (1.0 + share)
