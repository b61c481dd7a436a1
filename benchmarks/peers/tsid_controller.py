"""TSID on the same robot, tasks, contacts and states; run by its own Python."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np
import pinocchio as pin
import tsid
from serving import given, serve


def main():
    scene = given()
    model = pin.buildModelFromUrdf(scene["urdf"], pin.JointModelFreeFlyer())
    locked = [
        model.getJointId(name) for name in list(model.names)[2:] if name not in scene["joints"]
    ]
    if locked:
        model = pin.buildReducedModel(model, locked, pin.neutral(model))
    if list(model.names)[2:] != scene["joints"]:
        raise RuntimeError("the URDF orders the joints in another way")
    robot = tsid.RobotWrapper(model, False)
    peer = Formulation(robot, scene)
    states = np.array(scene["positions"]), np.array(scene["velocities"]), np.array(scene["com"])

    def run(tick):
        peer.switch(scene["active"][tick])
        peer.tick(tick, states[0][tick], states[1][tick], states[2][tick])

    serve(f"tsid {version('tsid')}, pin {pin.__version__}", run)


class Formulation:
    """The tasks and contacts of the scene, gains and weights as given."""

    def __init__(self, robot, scene):
        self.robot, self.scene = robot, scene
        q, v = np.array(scene["positions"][0]), np.array(scene["velocities"][0])
        self.problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
        self.problem.computeProblemData(0.0, q, v)
        gain = scene["stiffness"]
        self.contacts, self.active = {}, set()
        for frame in scene["feet"]:
            self.contacts[frame] = self.contact(frame, gain)
        self.switch(scene["feet"])
        self.com = tsid.TaskComEquality("com", robot)
        self.gains(self.com, 3, gain)
        self.problem.addMotionTask(self.com, scene["com_weight"], 1, 0.0)
        self.sample = tsid.TrajectorySample(3)
        trunk = tsid.TaskSE3Equality("trunk", robot, scene["trunk"])
        self.gains(trunk, 6, gain)
        trunk.setMask(np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))
        placement = robot.framePosition(
            self.problem.data(), robot.model().getFrameId(scene["trunk"])
        )
        trunk.setReference(tsid.TrajectorySE3Constant("trunk", placement).computeNext())
        self.problem.addMotionTask(trunk, scene["trunk_weight"], 1, 0.0)
        posture = tsid.TaskJointPosture("posture", robot)
        self.gains(posture, robot.na, gain)
        posture.setReference(tsid.TrajectoryEuclidianConstant("posture", q[7:]).computeNext())
        self.problem.addMotionTask(posture, scene["posture_weight"], 1, 0.0)
        bounds = tsid.TaskActuationBounds("torque", robot)
        limit = np.array(scene["torque_limit"])
        bounds.setBounds(-limit, limit)
        self.problem.addActuationTask(bounds, 1.0, 0, 0.0)
        stops = tsid.TaskJointPosVelAccBounds("stops", robot, 1e-3, False)
        stops.setPositionBounds(np.array(scene["lower"]), np.array(scene["upper"]))
        stops.setVelocityBounds(np.array(scene["speed"]))
        stops.setAccelerationBounds(np.full(robot.na, 1e3))
        self.problem.addMotionTask(stops, 1.0, 0, 0.0)
        self.trunk, self.posture, self.bounds, self.stops = trunk, posture, bounds, stops
        self.solver = tsid.SolverHQuadProgFast("solver")
        self.resize()

    @staticmethod
    def gains(task, size, stiffness):
        task.setKp(stiffness * np.ones(size))
        task.setKd(2.0 * stiffness**0.5 * np.ones(size))

    def contact(self, frame, gain):
        scene, up = self.scene, np.array([0.0, 0.0, 1.0])
        heaviest = 10.0 * scene["weight"]
        if scene["flat"]:
            x, y = 0.5 * np.array(scene["sole"])
            corners = np.array([[-x, -x, x, x], [-y, y, -y, y], [0.0] * 4])
            made = tsid.Contact6d(
                frame, self.robot, frame, corners, up, scene["friction"], 0.0, heaviest
            )
            size = 6
        else:
            made = tsid.ContactPoint(frame, self.robot, frame, up, scene["friction"], 0.0, heaviest)
            made.useLocalFrame(False)
            size = 3
        made.setKp(np.zeros(size))
        made.setKd(10.0 * np.ones(size))
        placement = self.robot.framePosition(
            self.problem.data(), self.robot.model().getFrameId(frame)
        )
        made.setReference(placement)
        return made

    def switch(self, wanted):
        """Add and remove contacts until those wanted are active."""
        wanted = set(wanted)
        if wanted == self.active:
            return
        for frame in self.active - wanted:
            self.problem.removeRigidContact(frame, 0.0)
        for frame in wanted - self.active:
            self.problem.addRigidContact(self.contacts[frame], 1e-4)
        self.active = wanted
        if hasattr(self, "solver"):
            self.resize()

    def resize(self):
        self.solver.resize(self.problem.nVar, self.problem.nEq, self.problem.nIn)

    def tick(self, number, q, v, com):
        self.sample.value(com[0])
        self.sample.derivative(com[1])
        self.sample.second_derivative(com[2])
        self.com.setReference(self.sample)
        data = self.problem.computeProblemData(1e-3 * number, q, v)
        solution = self.solver.solve(data)
        if solution.status != 0:
            raise RuntimeError(f"TSID failed at tick {number}: {solution.status}")
        # it has no friction of joints: known friction is added
        return self.problem.getActuatorForces(solution) + self.scene["dry"] * np.sign(v[6:])


if __name__ == "__main__":
    main()
