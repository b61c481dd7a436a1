"""Writing down what a plant does, in the columns of a log."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.measurement import Log
from wbc.measurement.schema import FREE_POSE, FREE_VELOCITY
from wbc.robot import Robot
from wbc.sim.result import StepResult
from wbc.sim.state import SimState
from wbc.sim.step.gears import Drivetrain


class Recorder:
    """Collects steps; `log` returns them as a log of true values.

    A row holds the state at its time and the torques and forces of the step that starts there:
    `rotor_torque` as the drives report it, `joint_torque` what the gears pass to the joints, and
    contact forces as means over the step, impacts included. Where a gear is compliant or has play
    `rotor_position` and `rotor_velocity` stand beside the joint's own position and velocity.
    """

    def __init__(self, robot: Robot, temperature: FloatArray | None = None) -> None:
        """Prepare to record `robot`, and the temperature (m,) of its motors where it is known."""
        self._robot, self._temperature = robot, temperature
        self._single = [
            (name, robot.position_index(name), robot.velocity_index(name))
            for name in robot.single_joints
            if robot.model.joints[robot.model.getJointId(name)].nq == 1
        ]
        self._drive = Drivetrain.of(robot)
        self._rows: list[tuple[float | FloatArray, ...]] = []

    def add(self, state: SimState, result: StepResult) -> None:
        """Record the step from `state` that gave `result`."""
        torque = self._robot.transmission.motor_from_joint.T @ result.mesh_torque
        force = result.contact_force[: len(self._robot.contacts)].ravel()
        loose, at = self._drive.any_loose, self._robot.actuated_position
        turn = self._drive.rotors(state, at) if loose else ()
        shown = state.time, state.position, state.velocity, result.command, torque, force
        self._rows.append((*shown, *turn))

    def log(self) -> Log:
        """Return everything recorded so far.

        Raises:
            SimulationError: fewer than two rows.
        """
        if len(self._rows) < 2:
            raise SimulationError("a recording needs at least two steps to be a log.")
        times, q, v, rotor, joint, force, *turn = (
            np.array(part) for part in zip(*self._rows, strict=True)
        )
        columns: dict[str, FloatArray] = {}
        for owner, (at_q, at_v) in self._robot.free_flyers.items():
            for i, quantity in enumerate(FREE_POSE):
                columns[f"{owner}.{quantity}"] = q[:, at_q + i]
            for i, quantity in enumerate(FREE_VELOCITY):
                columns[f"{owner}.{quantity}"] = v[:, at_v + i]
        for name, at_q, at_v in self._single:
            columns[f"{name}.position"] = q[:, at_q]
            columns[f"{name}.velocity"] = v[:, at_v]
        for i, name in enumerate(self._robot.transmission.joints):
            columns[f"{name}.rotor_torque"] = rotor[:, i]
            columns[f"{name}.joint_torque"] = joint[:, i]
            if self._temperature is not None:
                columns[f"{name}.temperature"] = np.full(len(times), self._temperature[i])
            if turn:
                columns[f"{name}.rotor_position"] = turn[0][:, i]
                columns[f"{name}.rotor_velocity"] = turn[1][:, i]
        for i, contact in enumerate(self._robot.contacts):
            for j, axis in enumerate("xyz"):
                columns[f"{contact.name}.force.{axis}"] = force[:, 3 * i + j]
        return Log(times, columns)
