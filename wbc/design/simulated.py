"""Which simulations a study may run for each design, and what they need."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.dynamics import evaluate
from wbc.errors import DesignError, SimulationError
from wbc.robot import Robot

if TYPE_CHECKING:
    from wbc.sim import SimState, StepResult

Row = dict[str, float]


def height_row(robot: Robot) -> int:
    """Return the row of q that moves the whole robot along z.

    Raises:
        DesignError: a robot whose base does not move along z.
    """
    model = robot.model
    if robot.has_free_flyer:
        return 2
    for joint in range(1, model.njoints):
        if model.joints[joint].shortname() == "JointModelPZ" and model.parents[joint] < joint:
            if model.names[joint] not in robot.transmission.joints:
                return int(model.joints[joint].idx_q)
            break
    raise DesignError(f"the base of '{robot.name}' cannot fall; only a floating base can.")


def placed(robot: Robot, q: FloatArray, lift: float) -> FloatArray:
    """Return q with the lowest contact `lift` [m] above the ground."""
    pose = q.copy()
    row = height_row(robot)
    heights = evaluate(robot, pose, np.zeros(robot.model.nv)).contact_position[:, 2]
    pose[row] += lift - float(heights.min())
    return pose


def drawn(robot: Robot, before: SimState, result: StepResult, tick: float) -> tuple[float, float]:
    """Return what the motors take in a tick [J]: as work, and with the heat of their windings.

    What one of them gives back is lost. The second is NaN without resistance and torque constant.
    """
    gears, torque = robot.transmission, result.rotor_torque
    speed = 0.5 * (before.velocity + result.state.velocity)[robot.actuated]
    power = torque * gears.gear_ratio * (gears.motor_from_joint @ speed)
    heat = gears.copper_loss * torque**2
    work, whole = (float(np.maximum(p, 0.0).sum()) * tick for p in (power, power + heat))
    return work, whole


def require_point_leg(robot: Robot) -> None:
    """Check that a robot has one contact, a planar base of three joints and two driven joints.

    Raises:
        DesignError: it does not.
    """
    model = robot.model
    kinds = [model.joints[j].shortname()[10:11] for j in range(1, model.njoints)]
    driven = robot.transmission.size
    if len(robot.contacts) != 1 or driven != 2 or kinds[:3] != ["P", "P", "R"]:
        raise DesignError(
            f"'{robot.name}' is no planar leg with one foot, a base of three joints and two "
            "driven joints: it cannot be simulated standing, landing or hopping. Leave these out "
            "of --simulate."
        )
    height_row(robot)


def require_quadruped(robot: Robot) -> None:
    """Check that a robot floats and has one foot in each corner, seen from above.

    Raises:
        DesignError: it does not.
    """
    corners = set()
    if robot.has_free_flyer:
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, robot.pose())
        for contact in robot.contacts:
            place = data.oMi[1].actInv(data.oMf[robot.model.getFrameId(contact.frame)])
            corners.add((place.translation[0] > 0.0, place.translation[1] > 0.0))
    if len(corners) != 4 or len(robot.contacts) != 4:
        raise DesignError(
            f"'{robot.name}' cannot trot: that needs a floating base and four contacts, one in "
            "each corner."
        )


@dataclass(frozen=True)
class SimulatedMetric:
    """One simulation and its columns.

    Attributes:
        columns: column -> unit.
        require: raises DesignError for a robot of another kind; needs neither plant nor controller.
        run: MODULE.FUNCTION of this room that returns the columns, given robot, pose and contact.
    """

    columns: Mapping[str, str]
    require: Callable[[Robot], object]
    run: str


SIMULATIONS: dict[str, SimulatedMetric] = {
    "drop": SimulatedMetric(
        {
            "drop_impulse": "N s",
            "drop_impulse_share": "1",
            "drop_mesh_loss": "J",
            "drop_ground_loss": "J",
        },
        height_row,
        "simulations.drop",
    ),
    "standing": SimulatedMetric(
        {
            "standing_torque": "N m",
            "standing_heat": "W",
            "standing_neutral_torque": "N m",
            "standing_neutral_heat": "W",
        },
        require_point_leg,
        "simulations.standing",
    ),
    "landing": SimulatedMetric(
        {"landing_error": "m", "landing_error_high": "m", "landing_error_low": "m"},
        require_point_leg,
        "simulations.landing",
    ),
    "hop": SimulatedMetric(
        {"hop_height": "m", "hop_energy": "J", "hop_cost": "1"},
        require_point_leg,
        "simulations.hop",
    ),
    "trot": SimulatedMetric(
        {"trot_speed": "m/s", "trot_cost": "1", "trot_work_cost": "1"},
        require_quadruped,
        "trotter.trot",
    ),
}


def simulate_design(name: str, robot: Robot, q: FloatArray, contact: str) -> Row:
    """Return the columns of one simulation; NaN where the design has no such motion.

    Raises:
        DesignError: a robot of another kind than the simulation needs.
    """
    metric = SIMULATIONS[name]
    metric.require(robot)
    # Plant and controller are loaded by whoever simulates, not by whoever plans a study.
    module, _, function = metric.run.partition(".")
    run = getattr(import_module(f"wbc.design.{module}"), function)
    try:
        return dict(run(robot, q, contact))
    except (SimulationError, DesignError):
        return dict.fromkeys(metric.columns, float("nan"))
