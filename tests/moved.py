"""Logs of robots on sums of sines, made by inverse dynamics, and of a servo that is simulated."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from wbc.dynamics import contact_torque, link_torque, rotor_torque
from wbc.effects import PayloadMass, load_robot
from wbc.measurement import Log
from wbc.robot import Motion, Robot
from wbc.sim.servo_rollout import DcDrive, ServoRun, servo_rollout

SUPPLY, STEP = 7.4, 0.004  # of the servo [V], of its logs [s]


def moved(
    robot: Robot,
    time: np.ndarray,
    waves: ArrayLike,
    noise: tuple[float, float, float] = (2e-5, 3e-3, 2e-3),
    seed: int = 0,
) -> Log:
    """Return a log of `robot`: exact torques and sensor noise.

    Args:
        waves: (joints, k, 3) size [rad], rate [rad/s] and phase [rad] of sines.
        noise: of position [rad], velocity [rad/s] and rotor torque [N m].
    """
    size, rate, phase = np.moveaxis(np.asarray(waves), -1, 0)[..., None]
    angle = rate * time + phase
    parts = (size * np.sin(angle), size * rate * np.cos(angle), -size * rate**2 * np.sin(angle))
    exact = exact_log(robot, Motion(*(np.sum(part, axis=1).T for part in parts), time=time))
    drawn = np.random.default_rng(seed).standard_normal((len(robot.joints), 3, len(time)))
    columns = {}
    for i, joint in enumerate(robot.joints):
        for k, quantity in enumerate(("position", "velocity", "rotor_torque")):
            name = f"{joint}.{quantity}"
            columns[name] = exact.column(name) + noise[k] * drawn[i, k]
    return Log(time, columns)


def exact_log(robot: Robot, motion: Motion, forces: Mapping[str, np.ndarray] | None = None) -> Log:
    """Return a log of a motion and the torques that the robot's drives need for it."""
    pushed = contact_torque(robot, motion.position, forces) if forces else 0.0
    torque, _ = rotor_torque(robot, motion, link_torque(robot, motion), pushed)
    columns = {}
    for quantity, joints, values in (
        ("position", robot.single_joints, motion.position),
        ("velocity", robot.single_joints, motion.velocity),
        ("rotor_torque", robot.transmission.joints, torque),
    ):
        columns |= {f"{j}.{quantity}": v for j, v in zip(joints, values.T, strict=True)}
    for contact, force in (forces or {}).items():
        columns |= {f"{contact}.force.{x}": f for x, f in zip("xyz", force.T, strict=True)}
    return Log(motion.time, columns)


def without_rows(log: Log, *rows: tuple[int, int]) -> Log:
    """Return a log that has lost its rows start <= row < stop."""
    kept = np.ones(len(log), dtype=bool)
    for start, stop in rows:
        kept[start:stop] = False
    columns = {name: values[kept] for name, values in log.columns.items()}
    return Log(log.time[kept], columns, log.source)


def swing(robot: Robot, seed: int, phase: float = 0.0, seconds: float = 6.0) -> Log:
    """Return a log of the fixed leg on two sines per joint."""
    rates = np.array([[2.3, 5.1], [3.1, 6.7]])
    waves = np.stack([np.full((2, 2), 0.35), rates, phase * rates[:, ::-1]], axis=-1)
    return moved(robot, np.arange(0.0, seconds, 4e-3), waves, seed=seed)


def servo(gain: float = 2.0, payload: float = 0.0) -> Robot:
    """Return a pendulum on a servo: its drive's gain [1/rad] and a payload [kg]."""
    robot = load_robot("xl330_pendulum").with_effect(PayloadMass("arm", payload))
    gears = robot.transmission
    duty = {"duty_gain": np.array([gain]), "supply_voltage": np.array([SUPPLY])}
    return robot.with_transmission(gears.replace(**duty))


def servo_log(robot: Robot, goal: np.ndarray, released: float = np.inf) -> Log:
    """Return targets [rad] and positions of a servo; its drive is off from some time [s] on."""
    time = STEP * np.arange(goal.size)
    gain = float(robot.transmission.duty_gain[0])
    run = ServoRun("run", gain, goal, np.where(time > released, 0.0, 1.0), 0.0 * time)
    position = servo_rollout([(robot, DcDrive(SUPPLY))], [run], STEP)[:, 0, 0]
    columns = {"shaft.position": position, "shaft.target_position": goal}
    return Log(time, columns | ({"shaft.enabled": run.enabled} if released < time[-1] else {}))


def waving(robot: Robot) -> Log:
    """Return a log in which joints and base wave, and torques and forces are any."""
    time, random = np.arange(400) / 100.0, np.random.default_rng(1)
    columns: dict[str, np.ndarray] = {}

    def wave(size: float, mean: float = 0.0) -> np.ndarray:
        angle = np.outer(time, random.uniform(1.0, 9.0, 3)) + random.uniform(0.0, 6.0, 3)
        return mean + size * np.sin(angle).sum(axis=1)

    usual = robot.pose() if robot.poses else np.full(robot.model.nq, 0.3)
    for joint, place in zip(robot.transmission.joints, robot.actuated_position, strict=True):
        columns[f"{joint}.position"] = wave(0.1, usual[place])
        columns[f"{joint}.rotor_torque"] = wave(0.2)
    if robot.has_free_flyer:
        names = [f"position.{x}" for x in "xyz"] + [f"orientation.{x}" for x in "xyzw"]
        for name, mean in zip(names, usual[:7], strict=True):
            columns[f"base.{name}"] = wave(0.02, mean)
        norm = np.linalg.norm([columns[f"base.{name}"] for name in names[3:]], axis=0)
        for name in names[3:]:
            columns[f"base.{name}"] = columns[f"base.{name}"] / norm
        for contact in robot.contacts:
            for axis, mean in zip("xyz", (0.0, 0.0, 6.0), strict=True):
                columns[f"{contact.name}.force.{axis}"] = wave(0.5, mean)
    return Log(time, columns)
