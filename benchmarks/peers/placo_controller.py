"""PlaCo's dynamics solver on the same robot, tasks, contacts and states; run by its own Python."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np
import placo
from serving import given, serve


def main():
    scene = given()
    robot = placo.RobotWrapper(scene["urdf"], placo.Flags.ignore_collisions)
    joints = scene["joints"]
    places = [robot.get_joint_offset(joint) for joint in joints]
    rows = [robot.get_joint_v_offset(joint) for joint in joints]
    states = np.array(scene["positions"]), np.array(scene["velocities"]), np.array(scene["com"])
    place(robot, states[0][0], states[1][0], places, rows)
    peer = Problem(robot, scene)

    def run(tick):
        peer.switch(scene["active"][tick])
        place(robot, states[0][tick], states[1][tick], places, rows)
        com = peer.com
        com.target_world, com.dtarget_world, com.ddtarget_world = states[2][tick]
        result = peer.solver.solve(False)
        if not result.success:
            raise RuntimeError(f"PlaCo failed at tick {tick}")
        # it has no friction of joints: known friction is added
        return result.tau[rows] + scene["dry"] * np.sign(states[1][tick][6:])

    serve(f"placo {version('placo')}, pin {version('pin')}", run)


def place(robot, position, velocity, places, rows):
    """Set the state and update the kinematics."""
    q, v = robot.state.q, robot.state.qd
    q[:7], v[:6] = position[:7], velocity[:6]
    q[places], v[rows] = position[7:], velocity[6:]
    robot.state.q, robot.state.qd = q, v
    robot.update_kinematics()


class Problem:
    """The tasks and contacts of the scene, gains and weights as given."""

    def __init__(self, robot, scene):
        self.robot, self.scene = robot, scene
        self.solver = placo.DynamicsSolver(robot)
        self.solver.dt = 1e-3
        gain = scene["stiffness"]
        self.com = self.solver.add_com_task(np.array(scene["com"][0][0]))
        self.com.configure("com", "soft", scene["com_weight"])
        self.com.kp, self.com.kd = gain, 2.0 * gain**0.5
        trunk = self.solver.add_orientation_task(
            scene["trunk"], robot.get_T_world_frame(scene["trunk"])[:3, :3]
        )
        trunk.configure("trunk", "soft", scene["trunk_weight"])
        trunk.kp, trunk.kd = gain, 2.0 * gain**0.5
        posture = self.solver.add_joints_task()
        posture.set_joints(dict(zip(scene["joints"], scene["positions"][0][7:], strict=True)))
        posture.configure("posture", "soft", scene["posture_weight"])
        posture.kp, posture.kd = gain, 2.0 * gain**0.5
        self.active = {}
        self.switch(scene["feet"])
        self.solver.enable_torque_limits(True)
        for joint, low, high, speed in zip(
            *(scene[key] for key in ("joints", "lower", "upper", "speed")), strict=True
        ):
            robot.set_joint_limits(joint, low, high)
            robot.set_velocity_limit(joint, speed)
        self.solver.enable_joint_limits(True)
        self.solver.enable_velocity_limits(True)

    def switch(self, wanted):
        """Add and remove contacts until those wanted are active."""
        if wanted == list(self.active):
            return
        for frame in [frame for frame in self.active if frame not in wanted]:
            task, contact = self.active.pop(frame)
            self.solver.remove_contact(contact)
            self.solver.remove_task(task)
        for frame in [frame for frame in wanted if frame not in self.active]:
            self.active[frame] = self.contact(frame)
        self.active = {frame: self.active[frame] for frame in wanted}

    def contact(self, frame):
        solver, placement = self.solver, self.robot.get_T_world_frame(frame)
        if self.scene["flat"]:
            task = solver.add_frame_task(frame, placement)
            task.configure(frame, "hard", 1.0)
            contact = solver.add_planar_contact(task)
            contact.length, contact.width = self.scene["sole"]
        else:
            task = solver.add_position_task(frame, placement[:3, 3])
            task.configure(frame, "hard", 1.0)
            contact = solver.add_point_contact(task)
            contact.unilateral = True
        contact.mu = self.scene["friction"]
        return task, contact


if __name__ == "__main__":
    main()
