"""The simulations of designs: a drop, standing, landing and hopping.

Each returns its columns for one design; what a design cannot do is NaN, so that a sweep goes on.
Standing, landing and hopping need a controller and are for planar legs: one contact, a base that
moves in the plane by joints of its own (two prismatic ones and a revolute one, none driven), and
two driven joints.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from scipy.optimize import brentq

from wbc.arrays import FloatArray
from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    PointContact,
    PointFootBalanceTask,
    PostureTask,
    Reference,
    RestPolicy,
)
from wbc.design.simulated import Row, drawn, height_row, placed, require_point_leg
from wbc.dynamics import evaluate
from wbc.errors import DesignError, SimulationError
from wbc.metrics import force_capability, link_length
from wbc.robot import Robot
from wbc.sim import Plant, SimState

_BEND = (-2.0, 2.0)  # [rad] about the pose, in which a balanced hip angle is looked for
_FALL = 0.1  # [m] of drop and landing: the height of the paper's leg in `sims.impact`
_TICK = 1e-3  # [s]
_STAND = (0.3, 0.2)  # [s] to come to rest, [s] over which the cost is taken
_SUNK = 0.02  # [m] by which a leg that stands never gives way: it moves by less than 0.1 mm
_LAND = 0.6  # [s] after touchdown: more than three time constants of the cushion
_CUSHION = 6.0  # [1/s] at which the leg gives way after touching down
_WRONG = 0.1  # share by which the controller's efficiencies are wrong
_PUSH = 1.0  # [s] after which a leg that has not left the ground counts as too weak
_STRETCH = 0.95  # share of the straight leg at which the push ends, short of the singular pose


@dataclass(frozen=True, eq=False)
class PointLeg:
    """The names and indices of a planar leg with a point foot.

    Attributes:
        robot: the leg.
        contact: name of its foot.
        base: name of the link that carries it.
        height: row of the base's height in q.
    """

    robot: Robot
    contact: str
    base: str
    height: int

    @classmethod
    def of(cls, robot: Robot, contact: str) -> PointLeg:
        """Return the leg.

        Raises:
            DesignError: a robot of another kind.
        """
        require_point_leg(robot)
        return cls(robot, contact, robot.bodies[2], height_row(robot))

    def balanced(self, q: FloatArray, lift: float = 0.0) -> FloatArray:
        """Return q with the centre of mass over the foot and the foot `lift` [m] above ground.

        The last driven joint keeps its angle, the first one turns.

        Raises:
            DesignError: no angle balances the leg.
        """
        pose, rest = q.copy(), np.zeros(self.robot.model.nv)
        joint = int(self.robot.actuated_position[0])
        middle = float(q[joint])

        def overhang(angle: float) -> float:
            pose[joint] = angle
            terms = evaluate(self.robot, pose, rest)
            return float(terms.center_of_mass[0] - terms.contact_position[0, 0])

        angles = middle + np.linspace(*_BEND, 81)
        signs = np.sign([overhang(angle) for angle in angles])
        changes = np.flatnonzero(signs[1:] != signs[:-1])
        if not changes.size:
            raise DesignError(f"no pose of '{self.robot.name}' balances on its foot.")
        nearest = changes[np.argmin(np.abs(angles[changes] - middle))]
        pose[joint] = brentq(overhang, angles[nearest], angles[nearest + 1])
        return placed(self.robot, pose, lift)

    def stance(self, policy: RestPolicy = RestPolicy.NEUTRAL) -> Controller:
        """Return the leg's `stance_controller` with a policy of rest."""
        settings = ControllerSettings(rest_policy=policy)
        return stance_controller(self.robot, settings, contact=self.contact, base=self.base)

    def mistaken(self, share: float) -> PointLeg:
        """Return the leg as a controller believes it: efficiencies wrong by `share`.

        Both efficiencies are multiplied by 1 + share and cut at 1, where a gear would create power.
        """
        gears = self.robot.transmission
        forward = np.minimum(gears.forward_efficiency * (1.0 + share), 1.0)
        backward = np.minimum(gears.backward_efficiency * (1.0 + share), 1.0)
        changed = gears.replace(forward_efficiency=forward, backward_efficiency=backward)
        return replace(self, robot=self.robot.with_transmission(changed))


def stance_controller(
    robot: Robot,
    settings: ControllerSettings | None = None,
    *,
    contact: str = "foot",
    base: str = "base",
) -> Controller:
    """Return the controller of height, balance and posture on a point foot that obeys `robot`."""
    tasks = [
        CenterOfMassTask(
            name="height", axes="z", weight=100.0, stiffness=400.0, acceleration_limit=np.inf
        ),
        PointFootBalanceTask(contact=contact, frame=base, weight=100.0),
        PostureTask.of(robot, weight=1e-3),
    ]
    return Controller(robot, tasks, [PointContact(name=contact)], settings=settings)


def stance_references(height: FloatArray) -> dict[str, Reference]:
    """Return what that controller is asked for at a height with its two rates (3,)."""
    wanted = Reference(height[:1], height[1:2], height[2:])
    return {"height": wanted, "balance": Reference(0.0)}


def drop(robot: Robot, q: FloatArray, contact: str) -> Row:
    """Return the first impact of the unpowered robot dropped from 10 cm in its pose."""
    pose, height = placed(robot, q, _FALL), height_row(robot)
    velocity = np.zeros(robot.model.nv)
    plant, rest = Plant(robot), np.zeros(robot.transmission.size)
    state = plant.state(pose, velocity)
    while True:
        result = plant.step(state, rest, 5.0 * _TICK)
        if result.impacts:
            break
        state = result.state
        if state.position[height] < pose[height] - 2.0 * _FALL:
            raise SimulationError("the dropped robot fell past the ground")
    hit = result.impacts[0]
    impulse = float(hit.contact_impulse[:, 2].sum())
    fallen = pin.computeTotalMass(robot.model) * float(np.sqrt(2.0 * 9.81 * _FALL))
    return {
        "drop_impulse": impulse,
        "drop_impulse_share": impulse / fallen,
        "drop_mesh_loss": float(hit.mesh_loss),
        "drop_ground_loss": float(hit.contact_loss),
    }


def standing(robot: Robot, q: FloatArray, contact: str) -> Row:
    """Return what standing still in a balanced pose costs, with and without the use of stiction."""
    leg = PointLeg.of(robot, contact)
    pose = leg.balanced(q)
    rows = {
        "standing": _standing_cost(leg, pose, RestPolicy.LEAST_TORQUE),
        "standing_neutral": _standing_cost(leg, pose, RestPolicy.NEUTRAL),
    }
    return {
        f"{name}_{what}": value
        for name, cost in rows.items()
        for what, value in zip(("torque", "heat"), cost, strict=True)
    }


def _standing_cost(leg: PointLeg, pose: FloatArray, policy: RestPolicy) -> tuple[float, float]:
    """Return rms rotor torque over gears [N m] and Joule heat [W], NaN if the leg falls."""
    robot, controller = leg.robot, leg.stance(policy)
    height = _height(robot, pose)
    references, plant = stance_references(np.array([height, 0.0, 0.0])), Plant(robot)
    state = plant.state(pose)
    quiet, spent = (round(time / _TICK) for time in _STAND)
    torques = []
    for _ in range(quiet + spent):
        command = controller.step(state, references)
        torques.append(command.rotor_torque)
        state = plant.step(state, command.rotor_torque, _TICK).state
        if abs(_height(robot, state.position) - height) > _SUNK:
            return np.nan, np.nan  # the motors are too weak to stand
    squared = np.mean(np.square(torques[quiet:]), axis=0)
    gears = robot.transmission
    heat = float(gears.copper_loss @ squared)
    return float(np.sqrt(squared.sum())), heat


def landing(robot: Robot, q: FloatArray, contact: str) -> Row:
    """Return how well the leg lands from 10 cm when its efficiencies are believed 10 % wrong."""
    leg = PointLeg.of(robot, contact)
    return {
        "landing_error": _landing_error(leg, leg),
        "landing_error_high": _landing_error(leg, leg.mistaken(_WRONG)),
        "landing_error_low": _landing_error(leg, leg.mistaken(-_WRONG)),
    }


def _landing_error(leg: PointLeg, believed: PointLeg) -> float:
    """Return the rms error of the height [m] after touchdown, NaN if the leg collapses.

    In the air the motors rest: the fall is the same for every controller. On the ground the
    reference starts with what the landing left of the height and its rate, and dies away critically
    damped, so that a controller that knows its gears makes no error but that of its sampling.
    """
    robot, controller = leg.robot, believed.stance()
    q = leg.balanced(leg.robot.pose())
    height = _height(robot, placed(robot, q, 0.0))
    plant = Plant(robot)
    state, rest = plant.state(placed(robot, q, _FALL)), np.zeros(robot.transmission.size)
    while not (result := plant.step(state, rest, _TICK)).impacts:
        state = result.state
    state, errors = result.state, []
    gap = _height(robot, state.position) - height
    rate, still = float(_com_rate(robot, state)[2]), np.array([height, 0.0, 0.0])
    for tick in range(round(_LAND / _TICK)):
        wanted = still + cushion(gap, rate, tick * _TICK)
        errors.append(_height(robot, state.position) - wanted[0])
        command = controller.step(state, stance_references(wanted))
        state = plant.step(state, command.rotor_torque, _TICK).state
    if abs(errors[-1]) > 0.5 * height:
        return np.nan
    return float(np.sqrt(np.mean(np.square(errors))))


def cushion(gap: float, rate: float, time: float) -> FloatArray:
    """Return what is left of a gap after a time, its rate and acceleration (3,) [m, s].

    It dies away critically damped, as a leg gives way after it has touched down.
    """
    w = _CUSHION
    slope = rate + w * gap
    left = gap + slope * time
    motion = np.array([left, slope - w * left, w * (w * left - 2.0 * slope)])
    return np.asarray(np.exp(-w * time) * motion)


def hop(robot: Robot, q: FloatArray, contact: str) -> Row:
    """Return how high the leg hops when its motors push as hard as they can lift.

    From the balanced pose the motors give the torques of one vertical force, the largest that they
    can lift there, until the leg is nearly straight or leaves the ground; then they rest. The
    height is that of the ballistic flight which follows: 0 for a leg too weak to rise. The energy
    is what the supply gives for the push: work and Joule heat of each motor, none of it taken
    back. The cost is that energy over m g height, the vertical cost of transport.
    """
    leg = PointLeg.of(robot, contact)
    pose = leg.balanced(q)
    reach = force_capability(robot, pose, contact, "xz").along([0.0, 1.0])
    plant, force = Plant(robot), reach.lift
    failed = {"hop_height": 0.0, "hop_energy": np.nan, "hop_cost": np.nan}
    if force <= pin.computeTotalMass(robot.model) * 9.81:
        return failed
    gears, state, energy = robot.transmission, plant.state(pose), 0.0
    straight = _STRETCH * _leg_length(leg)
    for _ in range(round(_PUSH / _TICK)):
        terms = evaluate(robot, state.position, state.velocity)
        push = np.zeros(gears.size)
        if _extension(leg, state) < straight:
            joint = terms.contact_jacobian[2, robot.actuated] * -force
            push = np.linalg.solve(gears.distribution, joint) / gears.forward_efficiency
        result = plant.step(state, push, _TICK)
        energy += drawn(robot, state, result, _TICK)[1]
        state = result.state
        if float(result.contact_force[0, 2]) <= 0.0:
            height = max(float(_com_rate(robot, state)[2]), 0.0) ** 2 / (2.0 * 9.81)
            lifted = pin.computeTotalMass(robot.model) * 9.81 * height
            cost = energy / lifted if lifted > 0.0 else np.nan
            return {"hop_height": height, "hop_energy": energy, "hop_cost": cost}
    return failed


def _extension(leg: PointLeg, state: SimState) -> float:
    """Return the distance from the base's joint to the foot [m]."""
    model, data = leg.robot.model, leg.robot.model.createData()
    pin.framesForwardKinematics(model, data, state.position)
    hip = model.getJointId(leg.robot.transmission.joints[0])
    foot = evaluate(leg.robot, state.position, state.velocity).contact_position[0]
    return float(np.linalg.norm(foot - data.oMi[hip].translation))


def _leg_length(leg: PointLeg) -> float:
    """Return the length [m] of the straight leg."""
    return sum(link_length(leg.robot, leg.robot.body_of(j)) for j in leg.robot.transmission.joints)


def _height(robot: Robot, q: FloatArray) -> float:
    return float(pin.centerOfMass(robot.model, robot.model.createData(), q)[2])


def _com_rate(robot: Robot, state: SimState) -> FloatArray:
    data = robot.model.createData()
    pin.centerOfMass(robot.model, data, state.position, state.velocity)
    return np.array(data.vcom[0])
