"""Random tree robots with lossy gears of any topology, on any base, with points that touch."""

import numpy as np
import pinocchio as pin

from wbc import Robot
from wbc.robot import ContactPoint
from wbc.transmission import Transmission

BASES = ("fixed", "planar", "free")


def _inertia(rng: np.random.Generator) -> pin.Inertia:
    box = pin.Inertia.FromBox(rng.uniform(0.3, 4.0), *rng.uniform(0.05, 0.5, 3))
    turned = pin.SE3(pin.Quaternion(*unit(rng, 4)).toRotationMatrix(), rng.normal(size=3) * 0.1)
    return turned.act(box)


def unit(rng: np.random.Generator, size: int) -> np.ndarray:
    vector = rng.normal(size=size)
    return vector / np.linalg.norm(vector)


def _base(model: pin.Model, base: str, rng: np.random.Generator) -> tuple[int, pin.SE3]:
    if base == "fixed":
        return 0, pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.6]))
    if base == "free":
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    else:
        joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
        joint = model.addJoint(joint, pin.JointModelPZ(), pin.SE3.Identity(), "z")
        joint = model.addJoint(joint, pin.JointModelRY(), pin.SE3.Identity(), "pitch")
    model.appendBodyToJoint(joint, _inertia(rng), pin.SE3.Identity())
    return joint, pin.SE3.Identity()


def random_robot(
    rng: np.random.Generator, base: str, eta_f: float, eta_b: float, mu: float, coupled: bool
) -> Robot:
    """Return a tree of one to five driven links with rigid gears; planar robots stay in x-z."""
    model = pin.Model()
    root, first = _base(model, base, rng)
    # Depth first, as pinocchio needs it: the next parent is the last link or one of its ancestors.
    chain, joints, contacts = [root], [], []
    for i in range(int(rng.integers(1, 6))):
        del chain[int(rng.integers(1, len(chain) + 1)) :]
        parent = chain[-1]
        offset = rng.uniform(-0.3, 0.3, 3)
        if base == "planar":
            kind, offset[1] = pin.JointModelRY(), 0.0
        elif rng.random() < 0.2:
            kind = pin.JointModelPrismaticUnaligned(unit(rng, 3))
        else:
            kind = pin.JointModelRevoluteUnaligned(unit(rng, 3))
        start = first if parent == 0 else pin.SE3.Identity()
        number = model.addJoint(parent, kind, start * pin.SE3(np.eye(3), offset), f"j{i}")
        model.appendBodyToJoint(number, _inertia(rng), pin.SE3.Identity())
        chain.append(number)
        joints.append(f"j{i}")
        tip = rng.uniform(-0.4, 0.4, 3)
        tip[1] *= base != "planar"
        place = pin.SE3(np.eye(3), tip)
        model.addFrame(pin.Frame(f"tip{i}", number, 0, place, pin.FrameType.OP_FRAME))
        contacts.append(ContactPoint(f"tip{i}", f"tip{i}", np.zeros(3), mu))
    return Robot("random", model, _gears(rng, joints, eta_f, eta_b), tuple(contacts), (), coupled)


def _gears(rng: np.random.Generator, joints: list[str], eta_f: float, eta_b: float) -> Transmission:
    m = len(joints)
    ratio = rng.uniform(10.0, 100.0, m) * rng.choice([-1.0, 1.0], m)
    topology = np.eye(m)
    if m > 1 and rng.random() < 0.5:
        topology[m - 1, m - 2] = -1.0  # a parallelogram
    spread = rng.uniform(0.0, 1.0, m)
    forward = eta_f + (1.0 - eta_f) * spread
    return Transmission(
        joints=tuple(joints),
        gear_ratio=ratio,
        rotor_inertia=rng.uniform(1e-3, 0.2, m) / ratio**2,
        topology=topology,
        forward_efficiency=forward,
        backward_efficiency=np.minimum(eta_b + spread * (1.0 - eta_b), 1.0 / forward),
        rotor_coulomb_friction=rng.uniform(0.0, 0.5, m) / np.abs(ratio),
        rotor_viscous_friction=rng.uniform(0.0, 0.1, m) / ratio**2,
    )


def softened(rng: np.random.Generator, robot: Robot) -> Robot:
    """Return the robot with gears that yield, each with or without play and damping; a few rigid.

    10 to 10 000 N m/rad, play of 0.1 to 100 mrad. Some gears with play have rigid flanks.
    """
    m = robot.transmission.size
    firm = rng.random(m) < 0.2
    play = np.where(rng.random(m) < 0.5, 10.0 ** rng.uniform(-4.0, -1.0, m), 0.0)
    damping = np.where(rng.random(m) < 0.7, 10.0 ** rng.uniform(-2.0, 1.5, m), 0.0)
    stiffness = np.where(firm, np.inf, 10.0 ** rng.uniform(1.0, 4.0, m))
    damping = np.where(firm, 0.0, damping)
    return geared(robot, stiffness=stiffness, damping=damping, backlash=play)


def geared(robot: Robot, **numbers) -> Robot:
    """Return the robot with other numbers of its gears, one for all or one for each."""
    m = robot.transmission.size
    arrays = {name: np.broadcast_to(value, (m,)) for name, value in numbers.items()}
    return robot.with_transmission(robot.transmission.replace(**arrays))
