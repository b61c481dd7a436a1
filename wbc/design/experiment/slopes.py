"""From slopes in what is read of torques to slopes in the motion, row by row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.design.experiment.aims import Pulls
from wbc.design.experiment.causes import Cause
from wbc.design.experiment.rivals import Predictions, Rivals
from wbc.dynamics import rotor_torque
from wbc.robot import Motion, Robot

_MOVES = (1e-6, 1e-6, 1e-4)
"""Steps of position [rad, m], velocity and acceleration. Torques have 15 digits and differences
over parameters, of 1e-4 typical sizes, 11: slopes keep five or more."""

Kinematics = tuple[FloatArray, FloatArray, FloatArray]
"""Of positions, velocities and accelerations of the driven joints, each (N, m)."""


def slopes_are_exact(rivals: Rivals, motion: Motion) -> bool:
    """Whether each row of the torques of all rivals follows from that row of the motion alone.

    Not so where an effect remembers (a delay, friction with memory), and where rotors turn with
    links: each evaluation then walks over the rows, which is too slow for slopes.
    """
    if rivals.robot.rotors_turn_with_links:
        return False
    fields = {"velocity": motion.velocity, "acceleration": motion.acceleration, "time": motion.time}
    some = motion.replace(
        position=motion.position[::2],
        **{name: None if rows is None else rows[::2] for name, rows in fields.items()},
    )
    whole, half = rivals.predictions(motion), rivals.predictions(some)
    return all(
        np.allclose(whole.torque(cause)[::2], half.torque(cause), rtol=1e-9, atol=1e-12)
        for cause in rivals.causes
    )


def motion_slopes(found: Predictions, pulls: Pulls, loads: dict[int, FloatArray]) -> Kinematics:
    """Return the slopes of an aim in positions, velocities and accelerations, each (N, m).

    Args:
        found: predictions along the motion, of rivals for which `slopes_are_exact`.
        pulls: slopes of the aim in what is read of the torques.
        loads: more slopes (N, m), in the torques themselves [1/(N m)], of causes by number; -1
            stands for the robot without any.
    """
    sums: FloatArray = np.zeros((3, len(found.motion.position), found.rivals.noise.size))
    near = _Nearby.of(found)
    for cause, slope in _torque_slopes(found, pulls, loads, sums):
        sums += near.pull(cause, slope)
    return sums[0], sums[1], sums[2]


def _torque_slopes(
    found: Predictions, pulls: Pulls, loads: dict[int, FloatArray], sums: FloatArray
) -> list[tuple[Cause, FloatArray]]:
    """Return slopes (N, m) in every torque that is predicted; those of the weights join `sums`."""
    noise, own = found.rivals.noise, dict(loads)
    shape = (len(found.motion.position), noise.size)
    every: list[tuple[Cause, FloatArray]] = []
    for number, flat in pulls.torque.items():
        slope: FloatArray = flat.reshape(shape)
        _add_weights(found, found.expected_torque(number), slope, sums)
        own[number] = own.get(number, 0.0) + found.readable.pull(slope) / noise
    for number, flat in pulls.sensitivity.items():
        here, slope = found.expected_torque(number), flat.reshape(*shape, -1)
        near = found.rivals.neighbours(number)
        columns = np.stack([lever * (found.torque(c) - here) for c, lever in near], axis=2)
        _add_weights(found, columns, slope, sums)
        pulled = found.readable.pull(slope) / noise[:, None]
        for k, (cause, lever) in enumerate(near):
            every.append((cause, lever * pulled[:, :, k]))
            own[number] = own.get(number, 0.0) - lever * pulled[:, :, k]
    causes = found.rivals.causes
    return every + [(causes[n] if n >= 0 else (), slope) for n, slope in own.items()]


def _add_weights(
    found: Predictions, torque: FloatArray, slope: FloatArray, sums: FloatArray
) -> None:
    noise = found.rivals.noise.reshape(-1, *(1,) * (torque.ndim - 2))
    velocity, acceleration = found.readable.weight_pull(torque / noise, slope)
    sums[1] += velocity
    sums[2] += acceleration


@dataclass(frozen=True, eq=False)
class _Nearby:
    """A motion with each joint moved a little in all rows: rows do not know of one another."""

    robot: Robot
    motion: Motion
    moved: tuple[tuple[int, int, FloatArray, Motion], ...]  # kind, joint, steps (N,), motion
    links: tuple[FloatArray, FloatArray]  # of the robot without any cause, as `_links`

    @classmethod
    def of(cls, found: Predictions) -> _Nearby:
        robot, motion, moved = found.rivals.robot, found.motion, []
        names = ("position", "velocity", "acceleration")
        for kind, (name, size) in enumerate(zip(names, _MOVES, strict=True)):
            rows = robot.actuated_position if kind == 0 else robot.actuated
            for joint, row in enumerate(rows):
                # Away from zero, so that no velocity changes its sign.
                sign = np.where(motion.velocity[:, robot.actuated[joint]] < 0.0, -1.0, 1.0)
                values = np.array(getattr(motion, name))
                values[:, row] += size * sign
                moved.append((kind, joint, size * sign, motion.replace(**{name: values})))
        return cls(robot, motion, tuple(moved), _links(robot, motion))

    def pull(self, cause: Cause, slope: FloatArray) -> FloatArray:
        """Return slopes (3, N, m) in the motion, given those (N, m) in the torque with a cause."""
        robot = self.robot.with_effects(*cause)
        here = _true(robot, cause, self.motion)
        shared = robot.model is self.robot.model and here is self.motion
        links, turned = self.links if shared else _links(robot, here)
        base = rotor_torque(robot, here, links)[0]
        result = np.zeros((3, *slope.shape))
        for kind, joint, steps, measured in self.moved:
            there = _true(robot, cause, measured)
            if there is measured:
                near = links + steps[:, None] * turned[kind][:, :, joint]
            else:
                near = links + _change(robot, here, there, turned)
            change = rotor_torque(robot, there, near)[0] - base
            result[kind, :, joint] = np.sum(slope * change, axis=1) / steps
        return result


def _links(robot: Robot, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return the torque (N, nv) of the links, and its slopes (3, N, nv, m) in the motion."""
    model, data = robot.model, robot.model.createData()
    torque = np.zeros((len(motion.position), model.nv))
    turned = np.zeros((3, len(torque), model.nv, robot.actuated.size))
    rows = zip(motion.position, motion.velocity, np.asarray(motion.acceleration), strict=True)
    for i, (q, v, a) in enumerate(rows):
        parts = pin.computeRNEADerivatives(model, data, q, v, a)
        torque[i] = data.tau
        for kind, part in enumerate(parts):
            turned[kind, i] = part[:, robot.actuated]
    return torque, turned


def _true(robot: Robot, cause: Cause, motion: Motion) -> Motion:
    for effect in reversed(cause):
        motion = effect.true(robot, motion)
    return motion


def _change(robot: Robot, here: Motion, there: Motion, turned: FloatArray) -> FloatArray:
    """Return how the torque of the links changes between two motions close by, (N, nv)."""
    moves = (
        (there.position - here.position)[:, robot.actuated_position],
        (there.velocity - here.velocity)[:, robot.actuated],
        (np.asarray(there.acceleration) - np.asarray(here.acceleration))[:, robot.actuated],
    )
    return np.asarray(
        sum(np.einsum("nij,nj->ni", t, m) for t, m in zip(turned, moves, strict=True))
    )
