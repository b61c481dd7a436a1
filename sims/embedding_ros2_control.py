"""The controller in the shape of a `ros2_control` controller, without ROS.

A controller of `ros2_control` lists the interfaces that it commands and reads, is configured and
activated, and then has `update` called with time and period; it exchanges numbers through named
interfaces such as `FL_HAA/position`. `WholeBodyController` is such a class in plain Python: a node
that has the robot's interfaces at hand only forwards these calls. `FakeHardware` stands for the
robot here: the library's own plant behind the same names.
"""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping
from enum import Enum

import numpy as np

from sims.legged import controller
from wbc import Robot, load_robot
from wbc.control import Command, Controller
from wbc.errors import WbcError
from wbc.robot import BaseState, JointMap
from wbc.sim import Plant, SimState

_BASE = (
    *(f"base/position.{axis}" for axis in "xyz"),
    *(f"base/orientation.{axis}" for axis in "xyzw"),
    *(f"base/linear_velocity.{axis}" for axis in "xyz"),  # in the world
    *(f"base/angular_velocity.{axis}" for axis in "xyz"),  # in the base's axes
)


class Return(Enum):
    """What a transition or an update returns, as `ros2_control` names it."""

    OK = "ok"
    ERROR = "error"


class WholeBodyController:
    """Configure, activate, update, deactivate.

    Attributes:
        message: why the last call returned an error, or what the last command said.
    """

    def __init__(self) -> None:
        """Start unconfigured."""
        self.message = ""
        self._controller: Controller | None = None
        self._joints: JointMap | None = None
        self._active = False

    def configure(self, parameters: Mapping[str, object]) -> Return:
        """Load the robot that `parameters["robot"]` names, joints in the order of "joints"."""
        try:
            robot = load_robot(str(parameters["robot"]))
            names = parameters.get("joints", robot.transmission.joints)
            self._joints = JointMap.of(robot, list(names))  # type: ignore[call-overload]
            self._controller = controller(robot, robot)
        except (WbcError, KeyError, TypeError) as cause:
            return self._failed(f"not configured: {cause}")
        return Return.OK

    @property
    def command_interfaces(self) -> list[str]:
        """Names of what `update` writes: torque on the rotors, and targets for the drives' PD."""
        kinds = ("effort", "position", "velocity")
        return [f"{joint}/{kind}" for joint in self._driven for kind in kinds]

    @property
    def state_interfaces(self) -> list[str]:
        """Names of what `update` reads."""
        names = () if self._joints is None else self._joints.names
        joints = [f"{joint}/{kind}" for joint in names for kind in ("position", "velocity")]
        return [*joints, *_BASE]

    @property
    def _driven(self) -> tuple[str, ...]:
        return () if self._joints is None else self._joints.robot.transmission.joints

    def activate(self) -> Return:
        """Forget what was, so that targets begin where the robot is."""
        if self._controller is None:
            return self._failed("activate before configure")
        self._controller.reset()
        self._active = True
        return Return.OK

    def update(
        self,
        states: Mapping[str, float],
        commands: MutableMapping[str, float],
        time: float,
        period: float,
    ) -> Return:
        """Read states, write commands; the torque of a refused tick is safe and written too."""
        control, joints = self._controller, self._joints
        if control is None or joints is None or not self._active:
            return self._failed("update before activate")
        try:
            position = [states[f"{joint}/position"] for joint in joints.names]
            velocity = [states[f"{joint}/velocity"] for joint in joints.names]
            base = [states[name] for name in _BASE]
            trunk = BaseState.of(base[:3], base[3:7], base[7:10], base[10:])
            command = control.step(joints.motion(position, velocity, trunk), dt=period)
        except (WbcError, KeyError) as cause:
            return self._failed(f"no state: {cause}")
        self._write(command, commands)
        self.message = command.message
        return Return.OK if command.status.usable else Return.ERROR

    def deactivate(self) -> Return:
        """Leave the robot to its drives."""
        self._active = False
        return Return.OK

    def _write(self, command: Command, commands: MutableMapping[str, float]) -> None:
        for i, joint in enumerate(self._driven):
            commands[f"{joint}/effort"] = float(command.rotor_torque[i])
            commands[f"{joint}/position"] = float(command.position[i])
            commands[f"{joint}/velocity"] = float(command.velocity[i])

    def _failed(self, message: str) -> Return:
        self.message = message
        return Return.ERROR


class FakeHardware:
    """A robot behind named interfaces."""

    def __init__(self, robot: Robot) -> None:
        """Stand it on the ground."""
        self._robot, self._plant = robot, Plant(robot)
        self.state: SimState = self._plant.state(robot.pose())

    def read(self) -> dict[str, float]:
        """Return the values of all state interfaces."""
        robot, q, v = self._robot, self.state.position, self.state.velocity
        found = {}
        for joint in robot.transmission.joints:
            found[f"{joint}/position"] = float(q[robot.position_index(joint)])
            found[f"{joint}/velocity"] = float(v[robot.velocity_index(joint)])
        x, y, z, w = q[3:7]
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        base = np.concatenate([q[:7], turn @ v[:3], v[3:6]])
        return found | dict(zip(_BASE, base.tolist(), strict=True))

    def write(self, commands: Mapping[str, float], period: float) -> None:
        """Go on for a period [s] under the efforts commanded."""
        torque = np.array([commands[f"{j}/effort"] for j in self._robot.transmission.joints])
        self.state = self._plant.step(self.state, torque, period).state


def main(duration: float = 0.5, period: float = 2e-3) -> dict[str, float]:
    """Stand for `duration` seconds at a rate of 1/period; return what happened."""
    robot = load_robot("solo12")
    hardware, loop, commands = FakeHardware(robot), WholeBodyController(), dict[str, float]()
    loop.configure({"robot": "solo12", "joints": tuple(reversed(robot.transmission.joints))})
    loop.activate()
    start, errors = hardware.state.position, 0
    for tick in range(round(duration / period)):
        result = loop.update(hardware.read(), commands, tick * period, period)
        errors += result is not Return.OK
        hardware.write(commands, period)
    loop.deactivate()
    moved = float(np.abs(hardware.state.position - start).max())
    return {"errors": errors, "largest motion of a coordinate": moved}


if __name__ == "__main__":
    for name, figure in main().items():
        print(f"{name}: {figure:.3g}")
