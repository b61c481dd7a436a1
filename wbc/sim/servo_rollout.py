"""Position servos on DC motors: their drives and runs, and many of them simulated at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, field, replace
from itertools import product
from math import inf
from typing import Annotated, Any

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, Ranged, must
from wbc.compiled import Dense, OutDense, Places, Row, Table, compiled, local, make_ready
from wbc.effects.tables import effect_table, fill_delivered, fill_torques, left_for_hooks, near_rest
from wbc.errors import LogError, RobotError
from wbc.measurement import Log, Machine
from wbc.mechanics.laws import meeting_speed
from wbc.mechanics.linear import copy_to
from wbc.robot import Robot, state_gear
from wbc.structures import Structure


@dataclass(frozen=True)
class DcDrive(Ranged):
    """What feeds the winding of a servo's motor; torque constant and resistance are the gear's.

    The position loop sets the share of the supply voltage on the winding, duty = clip(gain
    (goal - position)). While the switch is closed the supply and its wires carry the current of
    the winding, so that on average

        duty (supply_voltage - source_resistance |i|) = resistance i + torque_constant * speed

    (no capacitor that could hold the voltage over a switching period). The heat of the current
    raises the winding's resistance to resistance (1 + rise),

        d rise / dt = heating resistance (1 + rise) i^2 - cooling rise.

    Sag, current limit and warm winding are the three ways in which a drive gives less than its
    duty says.

    Attributes:
        supply_voltage: without load [V].
        source_resistance: of supply, wires and bridge while the switch is closed [ohm]; 0 is no
            sag.
        current_limit: largest current through the winding [A].
        duty_limit: largest duty, at most 1.
        heating: rise of the resistance, as a share of itself, per heat in the winding [1/J].
        cooling: rate at which the winding loses its rise [1/s].
    """

    supply_voltage: float = field(metadata=must("> 0 V"))
    source_resistance: float = field(default=0.0, metadata=must(">= 0"))
    current_limit: float = field(default=inf, metadata=must("> 0 A"))
    duty_limit: float = field(default=1.0, metadata=must("> 0 and <= 1"))
    heating: float = field(default=0.0, metadata=must(">= 0"))
    cooling: float = field(default=0.0, metadata=must(">= 0"))

    _told, _raised = "DC drive: ", RobotError


@compiled(counted=False)
def winding_current(
    duty: float, back_emf: float, resistance: float, supply: float, source: float, limit: float
) -> float:
    """Return (duty V - e) / (R + R_s |duty|), clipped to the limit [A]; the law of `DcDrive`."""
    wanted = (duty * supply - back_emf) / (resistance + source * abs(duty))
    return min(max(wanted, -limit), limit)


@dataclass(frozen=True, eq=False)
class ServoRun:
    """Set point, power state and measured position of one joint.

    Attributes:
        name: of the log.
        gain: of the position loop in this run, duty per rad of error [1/rad].
        goal: (T,) set point [rad or m].
        enabled: (T,) 1 while powered, 0 while the winding is open.
        position: (T,) measured [rad or m]; its first value starts a simulation, at rest.
        machine: how drive and load of this run differ from the robot, None if in nothing.
    """

    name: str
    gain: float
    goal: FloatArray
    enabled: FloatArray
    position: FloatArray
    machine: Machine | None = None

    @classmethod
    def from_log(cls, log: Log, joint: str, gain: float, step: float) -> ServoRun:
        """Return the run of a log with position, target_position and, if there is one, enabled.

        Args:
            log: the log.
            joint: name of the driven joint.
            gain: of the position loop, duty per rad.
            step: time step of the even clock [s].

        Raises:
            LogError: a channel is missing.
        """
        for quantity in ("position", "target_position"):
            if not log.has(f"{joint}.{quantity}"):
                raise LogError(
                    f"{log.source.label}: the column '{joint}.{quantity}' is missing; a servo's "
                    "rollout needs position and set point."
                )
        time = np.arange(log.time[0], log.time[-1], step)
        last = np.searchsorted(log.time, time, side="right") - 1
        enabled = log.columns.get(f"{joint}.enabled", np.ones(len(log)))
        return cls(
            name=log.source.part or log.source.label,
            gain=gain,
            goal=np.interp(time, log.time, log.column(f"{joint}.target_position")),
            enabled=np.asarray(enabled[last]),
            position=np.interp(time, log.time, log.columns[f"{joint}.position"]),
            machine=log.machine,
        )


RATIO, INERTIA, WEIGHT, PHASE, CONSTANT, COULOMB, VISCOUS = range(7)
TORQUE, RESISTANCE, SUPPLY, SOURCE, CURRENT, DUTY, HEATING, COOLING = range(7, 15)


# Variants of a robot with one joint, with drives, each as the machines of some runs are.
#
#     numbers  (K, 15) columns RATIO to COOLING: link inertia, gravity's torque weight
#              sin(q + phase) + constant, friction of the rotor, winding, and `DcDrive`
#     laws     (K, 9) of the gears without what they bring, see `RowSystem`
#     joints   (E, 3) effects at the joint, see `EffectTable`
#     effects  (K E, 3) their numbers, variant by variant
#     drives   (K, 3) see `EffectTable`
#     gears    (K, 2) see `EffectTable`
#     kinds    (V L,) which of the K each rollout has, variant by variant and run by run
SERVOS = Structure(
    "Servos", (Dense, "numbers laws effects drives gears"), (Table, "joints"), (Places, "kinds")
)
Servos = Annotated[Any, SERVOS.kind]


@compiled(counted=False)
def next_speed(
    servos: Servos, kind: int, q: float, v: float, torque: float, brake: float, step: float
) -> float:
    """Return the speed after one step in which the gear, with all friction, obeys its law.

    Args:
        servos: see there.
        kind: number of the variant.
        q, v: position and speed at the start.
        torque: of the motor [N m].
        brake: damping at the joint by the back-EMF [N m s/rad]; it acts at the middle of the step,
            as at its start the winding would brake half a step late.
        step: h [s].
    """
    own, law, count = servos.numbers[kind], local(9), len(servos.joints)
    at, speed, smooth, dry = local(1), local(1), local(1), local(1)
    command, rotor = local(1), local(1)
    at[0], speed[0], command[0] = q, v, torque
    numbers = servos.effects[kind * count : (kind + 1) * count]
    fill_torques(servos.joints, numbers, at, speed, smooth, dry)
    fill_delivered(servos.drives[kind : kind + 1], command, rotor)
    copy_to(servos.laws[kind], law)
    share = near_rest(v, servos.gears[kind, 0], servos.gears[kind, 1])
    law[3], law[4] = law[3] / (1.0 - share), law[4] / (1.0 + share)
    law[2] += 0.5 * step * brake
    brought = step * own[RATIO] * (rotor[0] - own[VISCOUS] * own[RATIO] * v) + law[2] * v
    lost = step * abs(own[RATIO]) * own[COULOMB]
    law[0], law[1], law[5] = brought - lost, brought + lost, step * dry[0]
    falls = own[WEIGHT] * np.sin(q + own[PHASE]) + own[CONSTANT] - smooth[0]
    point = step * falls - own[INERTIA] * v
    return meeting_speed(law, point, own[INERTIA])


@compiled(counted=False)
def follow_targets(
    servos: Servos, goal: Dense, enabled: Dense, gain: Row, start: Row, step: float, q: OutDense
) -> None:
    """Write the positions (T, N) that servos reach.

    Args:
        servos: see there.
        goal, enabled: (T, L) of the runs.
        gain: (L,) duty per error of the runs [1/rad].
        start: (L,) positions of the runs.
        step: of the clock [s].
        q: to write.
    """
    for i in range(len(servos.kinds)):
        kind, run = servos.kinds[i], i % len(gain)
        own, place, v, rise = servos.numbers[kind], start[run], 0.0, 0.0
        turning = own[TORQUE] * own[RATIO]
        for k in range(len(q)):
            q[k, i] = place
            # Velocities live half a step before the positions (leapfrog), which start at rest.
            span, error = step if k else 0.5 * step, gain[run] * (goal[k, run] - place)
            duty = min(max(error, -own[DUTY]), own[DUTY])
            resistance, current, brake = own[RESISTANCE] * (1.0 + rise), 0.0, 0.0
            if enabled[k, run] > 0.5:
                limits = own[SUPPLY], own[SOURCE], own[CURRENT]
                current = winding_current(duty, turning * v, resistance, *limits)
                if abs(current) < own[CURRENT]:
                    brake = turning * turning / (resistance + own[SOURCE] * abs(duty))
            v = next_speed(servos, kind, place, v, own[TORQUE] * current, brake, span)
            rate, heat = own[COOLING] * span, own[HEATING] * resistance * current * current
            warmed = -np.expm1(-rate) / rate if rate > 1e-9 else 1.0
            rise = np.exp(-rate) * rise + warmed * span * heat
            place += step * v


def servo_rollout(
    variants: Sequence[tuple[Robot, DcDrive]], runs: Sequence[ServoRun], step: float
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

    Raises:
        RobotError: a robot with more than one joint, with a self-locking gear, without a torque
            constant and resistance, or with other effects than the first, or with effects that no
            table holds (`wbc.effects.tables`).
    """
    length = max(run.goal.size for run in runs)
    goal, enabled = (
        np.stack([np.pad(one, (0, length - one.size), "edge") for one in part], axis=1)
        for part in ([run.goal for run in runs], [run.enabled for run in runs])
    )
    gain, start = np.array([(run.gain, run.position[0]) for run in runs], dtype=float).T.copy()
    reached = np.empty((length, len(variants) * len(runs)))
    servos = _servos(variants, [run.machine for run in runs])
    make_ready("wbc.sim.servo_rollout")
    follow_targets(servos, goal, enabled, gain, start, step, reached)
    return reached.reshape(length, len(variants), len(runs))


def _servos(
    variants: Sequence[tuple[Robot, DcDrive]], machines: Sequence[Machine | None]
) -> Servos:
    """Return the variants, each as the machines of its runs are; most runs share a machine."""
    first = variants[0][0]
    names = [(effect.name, effect.where) for effect in first.effects]
    for robot, _ in variants:
        if robot.model.nv != 1 or robot.transmission.size != 1:
            raise RobotError(
                f"'{robot.name}' has {robot.model.nv} joints; a servo's rollout is for one driven "
                "joint."
            )
        if [(effect.name, effect.where) for effect in robot.effects] != names:
            raise RobotError("the variants of a servo must have the same effects, in other sizes.")
        if others := left_for_hooks(robot):
            raise RobotError(f"a servo's rollout does not know the effect {others[0].name}.")
    own = [machines.index(machine) for machine in machines]
    known = {pair: k for k, pair in enumerate(product(range(len(variants)), sorted(set(own))))}
    numbers, laws, tables = [], [], []
    for v, m in known:
        (robot, drive), machine = variants[v], machines[m]
        robot = robot if machine is None else machine.of(robot)
        gears = robot.transmission
        numbers.append(_numbers(robot, drive, machine is not None))
        eta = 1.0 / gears.forward_efficiency[0], gears.backward_efficiency[0]
        laws.append([0.0, 0.0, gears.reflected_inertia[0], *eta, 0.0, 0.0, np.inf, 0.0])
        tables.append(effect_table(robot))
    kinds = [known[v, m] for v in range(len(variants)) for m in own]
    return SERVOS.of(
        numbers=np.array(numbers),
        laws=np.array(laws),
        joints=tables[0].joints,
        effects=np.concatenate([table.numbers for table in tables]),
        drives=np.array([table.drives[0] for table in tables]),
        gears=np.array([table.gears[0] for table in tables]),
        kinds=np.array(kinds, dtype=np.int64),
    )


def _numbers(robot: Robot, drive: DcDrive, loaded: bool) -> list[float]:
    """Return RATIO to COOLING of a servo; `loaded` says that a log has a machine of its own."""
    gears = robot.transmission
    for key in ("torque_constant", "resistance"):
        if not getattr(gears, key)[0] > 0.0:
            raise RobotError(f"'{robot.name}' has no {key}; {state_gear(gears.joints[0], key)}")
    if gears.self_locking[0]:
        raise RobotError(f"the gear of '{robot.name}' is self-locking; use the simulator's step.")
    model, data = robot.model, robot.model.createData()
    zero, quarter, half = (  # gravity's torque: constant, or a harmonic of the angle
        pin.computeGeneralizedGravity(model, data, np.array([angle])).item()
        for angle in (0.0, 0.5 * np.pi, np.pi)
    )
    constant = 0.5 * (zero + half)
    if loaded and np.isfinite(gears.supply_voltage[0]):
        drive = replace(drive, supply_voltage=float(gears.supply_voltage[0]))
    inertia = pin.crba(model, data, np.zeros(1))[0, 0]
    weight = np.hypot(quarter - constant, zero - constant)
    phase = np.arctan2(zero - constant, quarter - constant)
    own = gears.rotor_coulomb_friction, gears.rotor_viscous_friction, gears.torque_constant
    friction = (float(number[0]) for number in (*own, gears.resistance))
    links = float(gears.gear_ratio[0]), float(inertia), float(weight), float(phase), constant
    return [*links, *friction, *astuple(drive)]
