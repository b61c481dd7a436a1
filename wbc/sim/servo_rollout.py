"""Position servos simulated many at a time: variants of one robot, each over all runs at once."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.errors import RobotError
from wbc.measurement import Machine
from wbc.robot import Effect, Motion, Robot, state_gear
from wbc.robot.dc_drive import DcDrive, next_rise, winding_current
from wbc.sim.servo_run import ServoRun


@dataclass(frozen=True, eq=False)
class _Variants:
    """Numbers of robots with one joint, (N,) each, and their effects with (N,) parameters."""

    robot: Robot
    effects: tuple[Effect, ...]
    numbers: dict[str, FloatArray]


class _Winding(NamedTuple):
    """Motor torque [N m], back-EMF damping at the joint [N m s/rad] and heat [W], (N,) each."""

    torque: FloatArray
    brake: FloatArray
    heat: FloatArray


def servo_rollout(
    variants: Sequence[tuple[Robot, DcDrive]],
    runs: Sequence[ServoRun],
    step: float,
    wanted: BoolArray | None = None,
) -> FloatArray:
    """Return the positions (T, V, L) that V variants of a servo reach in L runs.

    Each step solves the velocity-level law of the gear exactly (one joint: the convex step of the
    simulator has a closed form): sticking, reversal and either direction of mesh power need no
    special case. Runs shorter than the longest hold their last set point.

    Args:
        variants: robots with one driven joint and the same effects, in other sizes, with their
            drives.
        runs: what the servo was told; each may have a load and a supply voltage of its own.
        step: time step [s] of the runs.
        wanted: (V, L) which variant goes through which run; all if None. Elsewhere the positions
            are NaN.

    Raises:
        RobotError: a robot with more than one joint, with a self-locking gear, without a torque
            constant and resistance, or with other effects than the first.
    """
    pairs = np.ones((len(variants), len(runs)), dtype=bool) if wanted is None else wanted
    variant_of, run_of = np.nonzero(pairs)
    stack = _stacked(variants, variant_of, [run.machine for run in runs], run_of)
    length = max(run.goal.size for run in runs)
    goal = np.stack([_held(run.goal, length) for run in runs], axis=1)
    enabled = np.stack([_held(run.enabled, length) for run in runs], axis=1) > 0.5
    gain = np.array([run.gain for run in runs])[run_of]
    position = np.array([run.position[0] for run in runs], dtype=np.float64)[run_of]
    velocity, rise = np.zeros(run_of.size), np.zeros(run_of.size)
    result = np.full((length, *pairs.shape), np.nan)
    for k in range(length):
        result[k][pairs] = position
        error = gain * (goal[k][run_of] - position)
        # Velocities live half a step before the positions (leapfrog), which start at rest.
        span = step if k else 0.5 * step
        winding = _winding(stack.numbers, velocity, error, enabled[k][run_of], rise)
        velocity = _next_velocity(stack, position, velocity, winding, span)
        rise = next_rise(
            rise, winding.heat, stack.numbers["heating"], stack.numbers["cooling"], span
        )
        position = position + step * velocity
    return result


def _held(values: FloatArray, length: int) -> FloatArray:
    return np.concatenate([values, np.full(length - values.size, values[-1])])


def _winding(
    n: dict[str, FloatArray], velocity: FloatArray, error: FloatArray, on: Any, rise: FloatArray
) -> _Winding:
    """Return what the drives do at one instant, (N,) each."""
    duty = np.clip(error, -n["duty_limit"], n["duty_limit"])
    resistance = n["resistance"] * (1.0 + rise)
    current = winding_current(
        duty,
        n["torque_constant"] * n["ratio"] * velocity,
        resistance,
        n["supply_voltage"],
        n["source_resistance"],
        n["current_limit"],
    )
    flowing = np.where(on, current, 0.0)
    free = on & (np.abs(current) < n["current_limit"])
    total = resistance + n["source_resistance"] * np.abs(duty)
    brake = np.where(free, (n["torque_constant"] * n["ratio"]) ** 2 / total, 0.0)
    return _Winding(n["torque_constant"] * flowing, brake, resistance * flowing**2)


def _next_velocity(
    stack: _Variants, position: FloatArray, velocity: FloatArray, winding: _Winding, step: float
) -> FloatArray:
    """Return the velocity (N,) after one step of the set-valued mesh law, solved exactly."""
    n, motion = stack.numbers, Motion(position[..., None], velocity[..., None])
    rotor = winding.torque[..., None]
    smooth = -(n["weight"] * np.sin(position + n["phase"]) + n["constant"])
    dry = np.zeros(velocity.shape)
    for effect in stack.effects:
        rotor = effect.drive(stack.robot, motion, rotor)
    for effect in stack.effects:
        added = effect.rotor_torque(stack.robot, motion)
        rotor = rotor if added is None else rotor + added
        torque = effect.joint_torque(stack.robot, motion)
        smooth = smooth if torque is None else smooth + torque[..., 0]
        level = effect.joint_friction(stack.robot, motion)
        dry = dry if level is None else dry + level[..., 0]
    drag = n["rotor_viscous"] * n["ratio"] * velocity
    motor = n["ratio"] * (rotor[..., 0] - drag)
    lost = np.abs(n["ratio"]) * n["rotor_coulomb"]
    # Back-EMF at the middle of the step; at its start the winding would brake half a step late.
    brake = 0.5 * step * winding.brake
    # Loss gains are 1/eta_b: see `_numbers`.
    gains = n["forward"][..., None], 1.0 / n["backward"][..., None]
    for effect in stack.effects:
        gains = effect.gear_efficiencies(stack.robot, motion, *gains)
    n = {**n, "forward": gains[0][..., 0], "backward": 1.0 / gains[1][..., 0]}
    # The motion is forward if it is so against full friction, backward likewise, else it sticks.
    forward = _branch(n, velocity, smooth - dry, motor - lost, brake, step)
    backward = _branch(n, velocity, smooth + dry, motor + lost, brake, step)
    up, down = np.minimum(*forward), np.maximum(*backward)
    return np.where(up > 0.0, up, np.where(down < 0.0, down, 0.0))


def _branch(
    n: dict[str, FloatArray],
    velocity: FloatArray,
    joint: FloatArray,
    motor: FloatArray,
    brake: FloatArray,
    step: float,
) -> tuple[FloatArray, FloatArray]:
    """Return the next velocity if the motor drives, and if the joint drives."""
    result = []
    for gain in (n["forward"], n["backward"]):
        inertia = n["link_inertia"] + gain * (n["rotor_inertia"] + brake)
        result.append(velocity + step * (joint + gain * motor) / inertia)
    return result[0], result[1]


def _stacked(
    variants: Sequence[tuple[Robot, DcDrive]],
    rows: IntArray,
    machines: Sequence[Machine | None],
    run_of: IntArray,
) -> _Variants:
    """Return the numbers of the variants that `rows` (N,) names, each as its run's machine is."""
    robots = [robot for robot, _ in variants]
    names = [(effect.name, effect.where) for effect in robots[0].effects]
    for robot in robots:
        if robot.model.nv != 1 or robot.transmission.size != 1:
            raise RobotError(
                f"'{robot.name}' has {robot.model.nv} joints; a servo's rollout is for one driven "
                "joint."
            )
        if [(effect.name, effect.where) for effect in robot.effects] != names:
            raise RobotError("the variants of a servo must have the same effects, in other sizes.")
    # Most runs share a machine: each variant is loaded once for each.
    of_run = [machines.index(machine) for machine in machines]
    kinds = [(int(row), of_run[int(run)]) for row, run in zip(rows, run_of, strict=True)]
    table = {(v, m): _numbers(*variants[v], machines[m]) for v, m in dict.fromkeys(kinds)}
    first = table[kinds[0]]
    numbers = {key: np.array([table[kind][key] for kind in kinds]) for key in first}
    effects = [_stacked_effect([r.effects[k] for r in robots], rows) for k in range(len(names))]
    return _Variants(robots[0], tuple(effects), numbers)


def _stacked_effect(effects: Sequence[Effect], rows: IntArray) -> Effect:
    """Return one effect whose parameters are (N,) arrays, for hooks with that leading axis."""
    one = copy.copy(effects[0])
    for parameter in one.parameters:
        values = np.array([getattr(effect, parameter.name) for effect in effects])
        object.__setattr__(one, parameter.name, values[rows])
    return one


def _numbers(robot: Robot, drive: DcDrive, machine: Machine | None) -> dict[str, float]:
    robot = robot if machine is None else machine.of(robot)
    gears = robot.transmission
    own = np.nan if machine is None else float(gears.supply_voltage[0])
    motor = {
        "torque_constant": float(gears.torque_constant[0]),
        "resistance": float(gears.resistance[0]),
    }
    for key, value in motor.items():
        if not value > 0.0:
            raise RobotError(f"'{robot.name}' has no {key}; {state_gear(gears.joints[0], key)}")
    if gears.self_locking[0]:
        raise RobotError(f"the gear of '{robot.name}' is self-locking; use the simulator's step.")
    zero, quarter, half = (_gravity(robot, q) for q in (0.0, np.pi / 2.0, np.pi))
    constant = 0.5 * (zero + half)
    return {
        **motor,
        "ratio": float(gears.gear_ratio[0]),
        "rotor_inertia": float(gears.reflected_inertia[0]),
        "forward": float(gears.forward_efficiency[0]),
        "backward": 1.0 / float(gears.backward_efficiency[0]),
        "rotor_coulomb": float(gears.rotor_coulomb_friction[0]),
        "rotor_viscous": float(gears.rotor_viscous_friction[0]),
        "link_inertia": float(pin.crba(robot.model, robot.model.createData(), np.zeros(1))[0, 0]),
        "constant": constant,
        "weight": float(np.hypot(quarter - constant, zero - constant)),
        "phase": float(np.arctan2(zero - constant, quarter - constant)),
        "supply_voltage": own if np.isfinite(own) else drive.supply_voltage,
        "source_resistance": drive.source_resistance,
        "current_limit": drive.current_limit,
        "duty_limit": drive.duty_limit,
        "heating": drive.heating,
        "cooling": drive.cooling,
    }


def _gravity(robot: Robot, position: float) -> float:
    """Return the gravity torque at a position: a harmonic of it (revolute) or constant."""
    data = robot.model.createData()
    torque = pin.computeGeneralizedGravity(robot.model, data, np.array([position]))
    return float(torque[0])
