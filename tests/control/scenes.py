"""Robots, controllers and random states that several tests share."""

from dataclasses import replace

import numpy as np
import pinocchio as pin

from wbc import control
from wbc.dynamics import evaluate
from wbc.robot import Motion, Robot
from wbc.transmission import Transmission

# The measured speed is believed and every direction is certain: what the paper's equation says.
CERTAIN = control.SpeedBlend(full_speed=1e-9, correction=0.0, trusted_error=0.0)


def arm(m, generator):
    """Return a fixed-base arm whose first m joints are left, with random lossy gears."""
    model = pin.buildSampleModelManipulator()
    names = list(model.names)[1:]
    locked = [model.getJointId(name) for name in names[m:]]
    model = pin.buildReducedModel(model, locked, pin.neutral(model))
    model.armature = np.zeros(model.nv)
    gears = Transmission(
        joints=tuple(names[:m]),
        gear_ratio=generator.uniform(5.0, 50.0, m),
        rotor_inertia=generator.uniform(1e-5, 2e-3, m),
        forward_efficiency=generator.uniform(0.5, 0.95, m),
        backward_efficiency=generator.uniform(0.05, 0.95, m),
        torque_limit=generator.uniform(0.02, 0.6, m),
    )
    return Robot("arm", model, gears)


def contact_drift(robot, q, v, step=1e-6):
    """Return dJ/dt v (3k,) [m/s^2] of the contact points, by differences of their Jacobians."""
    ahead, behind = (pin.integrate(robot.model, q, way * step * v) for way in (1.0, -1.0))
    return (jacobian(robot, ahead) - jacobian(robot, behind)) @ v / (2.0 * step)


def jacobian(robot, q):
    """Return J (3k, nv) of the contact points."""
    return evaluate(robot, q, np.zeros(robot.model.nv)).contact_jacobian


def points(robot, **settings):
    """Return a point contact for each contact of a robot."""
    return [control.PointContact(name=contact.name, **settings) for contact in robot.contacts]


def usual(robot, *more):
    """Return a task of the centre of mass, a weak one of the posture, and more."""
    return [control.CenterOfMassTask(weight=10.0), control.PostureTask.of(robot, weight=0.1), *more]


TRUNK = {"solo12": "base_link", "anymal": "base", "talos": "torso_2_link"}


def trunk(robot, kind=control.FrameOrientationTask, **more):
    """Return a task of the trunk, of its orientation by default."""
    return kind(name="trunk", frame=TRUNK[robot.name], **more)


def upright(robot):
    """Return tasks that hold a robot up firmly, whatever its legs do."""
    posture = control.PostureTask.of(robot, weight=0.1, stiffness=50.0)
    return [control.CenterOfMassTask(weight=100.0), trunk(robot, weight=10.0), posture]


def still(robot):
    """Return a robot at rest in its usual pose."""
    return Motion(robot.pose(), np.zeros(robot.model.nv))


def center_of_mass(robot, q):
    return pin.centerOfMass(robot.model, robot.model.createData(), q).copy()


def place_of(robot, q, frame):
    """Return where the origin of a frame is (3,) [m]."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return data.oMf[robot.model.getFrameId(frame)].translation.copy()


def moved_on(robot, state, acceleration, step=1e-3):
    """Return the state that a plant without errors has a step later."""
    v = state.velocity + step * acceleration
    return Motion(pin.integrate(robot.model, state.position, step * v), v)


def random_state(robot, generator, *, spread=0.5, speed=1.0):
    """Return q and v around the neutral configuration."""
    step = generator.uniform(-spread, spread, robot.model.nv)
    q = pin.integrate(robot.model, robot.neutral(), step)
    return q, speed * generator.normal(size=robot.model.nv)


def leg_controller(robot, **changes):
    """Return a controller of a planar leg on its foot with a CoM and a posture task.

    That of the centre of mass has no limit, as in `leg_rows`.
    """
    settings = replace(control.ControllerSettings(speed_blend=CERTAIN), **changes)
    tasks = [
        control.CenterOfMassTask(axes="xz", weight=10.0, acceleration_limit=np.inf),
        control.PostureTask.of(robot, weight=0.1, stiffness=50.0),
    ]
    limits = [control.RotorTorqueLimit()]
    return control.Controller(robot, tasks, [control.PointContact(name="foot")], limits, settings)


def leg_rows(robot, terms, com_target, posture_target):
    """Return what `leg_controller`'s tasks ask, written down by hand: weighted rows and target."""
    nv, v = robot.model.nv, terms.velocity
    data = robot.model.createData()
    jacobian = pin.jacobianCenterOfMass(robot.model, data, terms.position)[[0, 2]]
    com = data.com[0][[0, 2]].copy()
    pin.centerOfMass(robot.model, data, terms.position, v, np.zeros(nv))
    drift = data.acom[0][[0, 2]]
    wanted = 100.0 * (com_target - com) - 20.0 * (jacobian @ v) - drift
    select = np.eye(nv)[robot.actuated]
    gap = posture_target - terms.position[robot.actuated_position]
    posture = 50.0 * gap - 2.0 * np.sqrt(50.0) * v[robot.actuated]
    rows = np.vstack([np.sqrt(10.0) * jacobian, np.sqrt(0.1) * select])
    target = np.concatenate([np.sqrt(10.0) * wanted, np.sqrt(0.1) * posture])
    return rows, target


def leg_references(com_target, posture_target):
    """Return the references that go with `leg_rows`."""
    return {
        "center_of_mass": control.Reference(com_target),
        "posture": control.Reference(posture_target),
    }


def moving(robot, seed, ticks, position, velocity):
    """Yield `ticks` states scattered around the stance by these deviations [rad, rad/s]."""
    generator = np.random.default_rng(seed)
    nv, q = robot.model.nv, robot.pose()
    for _ in range(ticks):
        at = pin.integrate(robot.model, q, position * generator.normal(size=nv))
        yield Motion(at, velocity * generator.normal(size=nv))
