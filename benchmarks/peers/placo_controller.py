"""PlaCo's dynamics solver on the same robot, tasks, contacts and states; run by its own Python.

Reads a scene (JSON) given as argument, then one line "first count" per block of ticks from
standard input, and answers each with the ticks' times in microseconds as JSON.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np
import placo


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        scene = json.load(file)
    robot = placo.RobotWrapper(scene["urdf"], placo.Flags.ignore_collisions)
    joints = scene["joints"]
    places = [robot.get_joint_offset(joint) for joint in joints]
    rows = [robot.get_joint_v_offset(joint) for joint in joints]
    states = np.array(scene["positions"]), np.array(scene["velocities"]), np.array(scene["com"])
    place(robot, states[0][0], states[1][0], places, rows)
    solver, com = problem(robot, scene)
    print(json.dumps(["ready", robot.model.nv]), flush=True)
    for line in sys.stdin:
        first, count = map(int, line.split())
        times = []
        for tick in range(first, first + count):
            start = time.perf_counter()
            place(robot, states[0][tick], states[1][tick], places, rows)
            com.target_world, com.dtarget_world, com.ddtarget_world = states[2][tick]
            result = solver.solve(False)
            times.append(1e6 * (time.perf_counter() - start))
            if not result.success:
                raise RuntimeError(f"PlaCo failed at tick {tick}")
        print(json.dumps(times), flush=True)


def place(robot, position, velocity, places, rows):
    """Set the state and update the kinematics."""
    q, v = robot.state.q, robot.state.qd
    q[:7], v[:6] = position[:7], velocity[:6]
    q[places], v[rows] = position[7:], velocity[6:]
    robot.state.q, robot.state.qd = q, v
    robot.update_kinematics()


def problem(robot, scene):
    """Return the solver and the centre-of-mass task, weights and gains as given."""
    solver = placo.DynamicsSolver(robot)
    solver.dt = 1e-3
    gain = scene["stiffness"]
    com = solver.add_com_task(np.array(scene["com"][0][0]))
    com.configure("com", "soft", scene["com_weight"])
    com.kp, com.kd = gain, 2.0 * gain**0.5
    trunk = solver.add_orientation_task(
        scene["trunk"], robot.get_T_world_frame(scene["trunk"])[:3, :3]
    )
    trunk.configure("trunk", "soft", scene["trunk_weight"])
    trunk.kp, trunk.kd = gain, 2.0 * gain**0.5
    posture = solver.add_joints_task()
    targets = dict(zip(scene["joints"], scene["positions"][0][7:], strict=True))
    posture.set_joints(targets)
    posture.configure("posture", "soft", scene["posture_weight"])
    posture.kp, posture.kd = gain, 2.0 * gain**0.5
    for frame in scene["feet"]:
        if scene["flat"]:
            task = solver.add_frame_task(frame, robot.get_T_world_frame(frame))
            task.configure(frame, "hard", 1.0)
            contact = solver.add_planar_contact(task)
            contact.length, contact.width = scene["sole"]
        else:
            task = solver.add_position_task(frame, robot.get_T_world_frame(frame)[:3, 3])
            task.configure(frame, "hard", 1.0)
            contact = solver.add_point_contact(task)
            contact.unilateral = True
        contact.mu = scene["friction"]
    solver.enable_torque_limits(True)
    return solver, com


if __name__ == "__main__":
    main()
