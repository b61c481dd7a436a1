"""The same scene in a browser window while something runs."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import final

import meshcat
import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.dynamics import Workspace
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.transmission import Direction
from wbc.view.channels import configuration, contact_forces, gear_flow
from wbc.view.ground import GroundSlab
from wbc.view.palette import DIRECTION_COLOURS, rgb
from wbc.view.scene import add_robot_scene
from wbc.view.shapes import along, robot_shapes


@final
class LiveView:
    """A robot in a browser, moved by the caller's own loop."""

    def __init__(
        self,
        robot: Robot,
        ground: Sequence[GroundSlab] = (),
        viewer: meshcat.Visualizer | None = None,
    ) -> None:
        """Draw the robot.

        Args:
            robot: to be shown.
            ground: slabs to stand on (`flat_ground`, `profile_ground`).
            viewer: where to draw; a new meshcat server, which prints its address, when left out.
        """
        self.robot = robot
        self.viewer = meshcat.Visualizer() if viewer is None else viewer
        self._root = self.viewer["/wbc"]
        self._root.delete()
        names = [contact.name for contact in robot.contacts]
        self._size = add_robot_scene(self._root, robot, robot_shapes(robot), tuple(ground), names)
        self._space = Workspace(robot)
        for part in ("Grid", "Axes"):
            self.viewer[f"/{part}"].set_property("visible", False)
        self.viewer["/Background"].set_property("top_color", [0.98, 0.985, 0.99])
        self.viewer["/Background"].set_property("bottom_color", [0.86, 0.88, 0.91])
        self._framed = True
        self.show(robot.neutral())
        self._framed = False

    def show(
        self,
        position: FloatArray,
        forces: Mapping[str, FloatArray] | None = None,
        directions: FloatArray | None = None,
    ) -> None:
        """Move the robot.

        Args:
            position: q (nq,).
            forces: contact name -> (3,) [N], ground on robot, world axes; none is drawn where
                left out or small.
            directions: (m,) +1, 0, -1 of the mesh power, for the colour of the joints.
        """
        model, data = self._space.model, self._space.data
        center = np.asarray(pin.centerOfMass(model, data, np.asarray(position)))
        for joint in range(model.njoints):
            self._root["robot"][f"j{joint}"].set_transform(data.oMi[joint].homogeneous)
        for frame, contact in zip(self._space.frames, self.robot.contacts, strict=True):
            point = np.asarray(pin.updateFramePlacement(model, data, frame).translation)
            self._show_force(contact.name, point, (forces or {}).get(contact.name, np.zeros(3)))
        self._root["com"]["ball"].set_transform(_moved(center))
        for part in ("floor", "line"):
            self._root["com"][part].set_property("visible", False)
        if directions is not None:
            self._show_directions(np.asarray(directions))
        if not self._framed:
            self.frame(center)

    def frame(self, target: FloatArray) -> None:
        """Bring a point (3,) [m] before the camera, at a distance that shows the whole robot.

        meshcat's camera turns around its own origin only, so it is the scene that is shifted. The
        first `show` does it; call it again after the robot has walked away.
        """
        self._framed = True
        offsets = np.array([place.translation for place in self.robot.model.jointPlacements])
        flat = not np.any(np.abs(offsets[:, 1]) > 1e-9)
        direction = np.array([0.3, -0.94, 0.2] if flat else [0.75, -0.6, 0.32])
        x, y, z = (float(part) for part in 1.3 * self._size.reach * direction)
        self._root.set_transform(_moved(-np.asarray(target)))
        # The camera's own frame has y up.
        self.viewer["/Cameras/default/rotated/<object>"].set_property("position", [x, z, -y])

    def play(self, log: Log, speed: float = 1.0) -> None:
        """Show a log from its start to its end, `speed` times as fast as it was.

        Raises:
            LogError: the log holds no position of the robot.
        """
        position, forces = configuration(self.robot, log), contact_forces(self.robot, log)
        directions = np.nan_to_num(gear_flow(self.robot, log).direction)
        begin = time.perf_counter()
        row, last = 0, len(log) - 1
        while True:
            here = {name: force[row] for name, force in forces.items()}
            self.show(position[row], here, directions[row])
            if row == last:
                return  # a slow window drops frames, but never the last one
            elapsed = speed * (time.perf_counter() - begin)
            row = max(row + 1, int(np.searchsorted(log.time, log.time[0] + elapsed)))
            row = min(row, last)
            time.sleep(max(0.0, (log.time[row] - log.time[0] - elapsed) / speed))

    def _show_force(self, name: str, point: FloatArray, force: FloatArray) -> None:
        place = self._root["contacts"][name]
        size = float(np.linalg.norm(force))
        shown = size > 0.02 * self._size.weight
        for part in ("shaft", "head", "cone"):
            place[part].set_property("visible", shown)
        if not shown:
            return
        turn = along(force)
        length = min(size * self._size.metres_per_newton, 1.1 * self._size.reach)
        shaft = max(length - self._size.arrow_head, 1e-4)
        place["shaft"].set_transform(_moved(point, turn @ np.diag([1.0, 1.0, shaft])))
        place["head"].set_transform(_moved(point + shaft * turn[:, 2], turn))
        place["cone"].set_transform(_moved(point))

    def _show_directions(self, directions: FloatArray) -> None:
        for joint, mode in zip(self.robot.transmission.joints, directions, strict=True):
            number = self.robot.model.getJointId(joint)
            colour = [*rgb(DIRECTION_COLOURS[Direction(int(mode))]), 1.0]
            self._root["robot"][f"j{number}"]["hub"].set_property("color", colour)


def _moved(point: FloatArray, linear: FloatArray | None = None) -> FloatArray:
    """Return the homogeneous matrix (4, 4) of a linear map (3, 3) and a translation (3,)."""
    matrix = np.eye(4)
    matrix[:3, 3] = point
    if linear is not None:
        matrix[:3, :3] = linear
    return matrix
