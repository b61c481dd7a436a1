"""The cube in three simulators: the same body, eight corner points, each its own contact law.

An engine is made with its contact parameters and then throws the cube from a `Start`. Every one
has Coulomb friction with the coefficient it is given; what happens along the normal is its own:

    wbc      restitution (Newton), a rigid ground; nothing else to choose
    wbc, compliant  stiffness [N/m^(3/2)] and dissipation [s/m] (Hunt and Crossley)
    MuJoCo   time constant [s] and damping ratio of the soft constraint (`solref`)
    Drake    stiffness [N/m] and dissipation [s/m] of the point contact (Hunt and Crossley)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import mujoco
import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from benchmarks.cube_tosses.data import CORNERS, HALF_EDGE, INERTIA, MASS, Start
from wbc import Robot
from wbc.robot import ContactPoint
from wbc.sim import HuntCrossley, Plant
from wbc.transmission import Transmission

Path = tuple[np.ndarray, Rotation]
Throw = Callable[[Start, np.ndarray], Path]
"""Takes a start and the times (n,) [s] of the frames, the first at zero; returns the cube there."""

RADIUS = 1e-4  # [m] of the corner spheres where an engine has no points
STEP = 1e-3  # [s], at most; every frame is a whole number of steps


def steps_per_frame(time: np.ndarray) -> int:
    """Return in how many steps of at most `STEP` the engines go from frame to frame."""
    return int(np.ceil((time[1] - time[0]) / STEP - 1e-9))


def cube(friction: float) -> Robot:
    """Return the cube as a robot without joints: a free base with eight contact points."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    inertia = pin.Inertia(MASS, np.zeros(3), INERTIA * np.eye(3))
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addBodyFrame("cube", joint, pin.SE3.Identity(), 0)
    points = [ContactPoint(f"corner_{i}", "cube", c, friction) for i, c in enumerate(CORNERS)]
    return Robot("cube", model, Transmission((), np.zeros(0), np.zeros(0)), tuple(points))


def wbc(friction: float, restitution: float) -> Throw:
    """Return this library's plant on a rigid ground."""
    return _thrown(Plant(cube(friction), restitution=restitution))


def wbc_compliant(friction: float, stiffness: float, dissipation: float) -> Throw:
    """Return this library's plant with compliant contacts."""
    return _thrown(Plant(cube(friction), compliance=HuntCrossley(stiffness, dissipation)))


def _thrown(plant: Plant) -> Throw:
    def throw(start: Start, time: np.ndarray) -> Path:
        back = start.rotation.inv()
        q = np.concatenate([start.position, start.rotation.as_quat()])
        state = plant.state(q, np.concatenate([back.apply(start.velocity), back.apply(start.spin)]))
        seen, count = [q], steps_per_frame(time)
        for length in np.diff(time):
            for _ in range(count):
                state = plant.step(state, np.zeros(0), length / count).state
            seen.append(state.position)
        found = np.array(seen)
        return found[:, :3], Rotation.from_quat(found[:, 3:7])

    return throw


def mujoco_engine(friction: float, time_constant: float, damping_ratio: float) -> Throw:
    """Return MuJoCo with elliptic friction cones."""
    spec = mujoco.MjSpec()
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    law = {
        "friction": [friction, 0.0, 0.0],
        "solref": [time_constant, damping_ratio],
        "condim": 3,
    }
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[9, 9, 1], **law, contype=1, conaffinity=2
    )
    body = spec.worldbody.add_body(mass=MASS, inertia=[INERTIA] * 3, explicitinertial=True)
    body.add_freejoint()
    for corner in CORNERS:
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[RADIUS, 0, 0],
            pos=inside(corner),
            mass=0.0,
            contype=2,
            conaffinity=1,
            **law,
        )
    model = spec.compile()
    data = mujoco.MjData(model)

    def throw(start: Start, time: np.ndarray) -> Path:
        mujoco.mj_resetData(model, data)
        data.qpos[:] = np.concatenate([start.position, start.rotation.as_quat()[[3, 0, 1, 2]]])
        # MuJoCo has the base's linear velocity in world axes, its angular one in body axes.
        data.qvel[:] = np.concatenate([start.velocity, start.rotation.inv().apply(start.spin)])
        seen, count = [np.array(data.qpos)], steps_per_frame(time)
        for length in np.diff(time):
            model.opt.timestep = length / count
            mujoco.mj_step(model, data, count)
            seen.append(np.array(data.qpos))
        found = np.array(seen)
        return found[:, :3], Rotation.from_quat(found[:, [4, 5, 6, 3]])

    return throw


def drake_engine(friction: float, stiffness: float, dissipation: float) -> Throw:
    """Return Drake's MultibodyPlant with point contact; raises ImportError where there is none."""
    from pydrake.geometry import AddContactMaterial, HalfSpace, ProximityProperties, Sphere
    from pydrake.math import RigidTransform, RotationMatrix
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
    from pydrake.multibody.tree import SpatialInertia, UnitInertia
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder

    frame = 1.0 / 148.0
    step = frame / np.ceil(frame / STEP)
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=step)
    law = ProximityProperties()
    AddContactMaterial(dissipation, stiffness, CoulombFriction(friction, friction), law)
    plant.RegisterCollisionGeometry(
        plant.world_body(), RigidTransform(), HalfSpace(), "ground", law
    )
    unit = UnitInertia(*[INERTIA / MASS] * 3)
    body = plant.AddRigidBody("cube", SpatialInertia(MASS, np.zeros(3), unit))
    for i, corner in enumerate(CORNERS):
        place = RigidTransform(inside(corner))
        plant.RegisterCollisionGeometry(body, place, Sphere(RADIUS), f"corner_{i}", law)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    return _drake_throw(simulator, plant, step, RigidTransform, RotationMatrix)


def _drake_throw(simulator, plant, step, transform, matrix) -> Throw:
    from pydrake.multibody.math import SpatialVelocity

    context = simulator.get_mutable_context()
    inner = plant.GetMyMutableContextFromRoot(context)
    body = plant.GetBodyByName("cube")

    def throw(start: Start, time: np.ndarray) -> Path:
        context.SetTime(0.0)
        pose = transform(matrix(start.rotation.as_matrix()), start.position)
        plant.SetFreeBodyPose(inner, body, pose)
        plant.SetFreeBodySpatialVelocity(inner, body, SpatialVelocity(start.spin, start.velocity))
        simulator.Initialize()
        position, turn = [start.position], [start.rotation.as_matrix()]
        count = round((time[1] - time[0]) / step)
        for frame in range(1, len(time)):
            # The update at the end of an interval belongs to the next one.
            simulator.AdvanceTo((frame * count - 0.5) * step)
            now = plant.EvalBodyPoseInWorld(inner, body)
            position.append(now.translation())
            turn.append(now.rotation().matrix())
        return np.array(position), Rotation.from_matrix(np.array(turn))

    return throw


def inside(corner: np.ndarray) -> np.ndarray:
    """Return where a corner sphere's centre lies, so that the sphere ends at the cube's faces."""
    return np.asarray(corner * (1.0 - RADIUS / HALF_EDGE))


ENGINES: Mapping[str, Callable[..., Throw]] = {
    "wbc": wbc,
    "wbc, compliant": wbc_compliant,
    "MuJoCo": mujoco_engine,
    "Drake": drake_engine,
}
