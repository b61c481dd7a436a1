"""How the machine of one log differs from the robot that its logs are held against."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, frozen
from wbc.dynamics import inertial_parameters
from wbc.errors import LogError
from wbc.measurement.log import Log
from wbc.robot import Robot
from wbc.transmission import Transmission

_OF_THE_DRIVE = (
    "position_gain",
    "velocity_gain",
    "duty_gain",
    "supply_voltage",
    "torque_limit",
)


@dataclass(frozen=True, eq=False)
class Machine:
    """The drives and loads of one log.

    Attributes:
        transmission: of the robot, with this log's numbers of the drives.
        inertia: (10 n_links,) what its links have more than the robot's, in pinocchio's dynamic
            parameters: a payload.
    """

    transmission: Transmission
    inertia: FloatArray

    def of(self, robot: Robot) -> Robot:
        """Return the robot with these drives and loads."""
        links = loaded(robot.model, self.inertia).inertias
        drives = {name: getattr(self.transmission, name) for name in _OF_THE_DRIVE}
        return robot.with_inertias(dict(enumerate(list(links)[1:], start=1))).with_transmission(
            robot.transmission.replace(**drives)
        )


def loaded(model: pin.Model, inertia: FloatArray | None) -> pin.Model:
    """Return a copy of a model whose links have more, (10 n_links,) or None for nothing."""
    result = model.copy()
    if inertia is not None:
        for k, more in enumerate(inertia.reshape(-1, 10), start=1):
            total = model.inertias[k].toDynamicParameters() + more
            result.inertias[k] = pin.Inertia.FromDynamicParameters(total)
    return result


def with_machine(log: Log, robot: Robot, own: Robot) -> Log:
    """Return a log of `own`, a machine that differs from `robot` in its drives or its loads.

    Raises:
        LogError: it differs in something else, which all logs have to share.
    """
    theirs, ours = own.transmission, robot.transmission
    different = [
        field.name
        for field in fields(Transmission)
        if field.name not in _OF_THE_DRIVE
        and not _same(getattr(theirs, field.name), getattr(ours, field.name))
    ]
    placements = [
        (one.jointPlacements, one.names, one.gravity.linear) for one in (own.model, robot.model)
    ]
    same_joints = list(placements[0][1]) == list(placements[1][1])
    if not same_joints or not all(
        a.isApprox(b) for a, b in zip(placements[0][0], placements[1][0], strict=True)
    ):
        different.append("joints")
    elif not np.array_equal(placements[0][2], placements[1][2]):
        different.append("gravity")
    known = {(e.name, e.where, tuple(e.values.items())) for e in robot.effects}
    different += [
        f"{e.name} at {e.where}"
        for e in own.effects
        if "change" not in e.acts_by and (e.name, e.where, tuple(e.values.items())) not in known
    ]
    if different:
        raise LogError(
            f"{log.source.label}: its robot '{own.name}' differs from '{robot.name}' in "
            f"{', '.join(different)}. The robots of logs that are judged together may differ in "
            "gains, supply voltage and torque limit of the drives and in the inertia of the links."
        )
    inertia = inertial_parameters(own) - inertial_parameters(robot)
    return log.with_machine(Machine(theirs, frozen(inertia)))


def _same(one: object, other: object) -> bool:
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return np.array_equal(one, other, equal_nan=True)
    return one == other
