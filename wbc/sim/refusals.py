"""Why a step is refused."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.mechanics.newton import SEVERAL
from wbc.sim.setup import Setup
from wbc.sim.step.course import NO_COMMAND
from wbc.sim.step.solution import NO_INERTIA
from wbc.sim.step.tables import TOUCH


def failure(setup: Setup, code: int, torque: FloatArray) -> SimulationError:
    """Return the error for what `take_step` returned with a command (m,) [N m]."""
    if code == NO_COMMAND:
        return SimulationError(f"rotor_torque holds a value that is no number: {torque}.")
    gears, joints = setup.plant.gears, setup.robot.transmission.joints
    inertia, velocity = setup.plant.placed.inertia.copy(), setup.plant.now.velocity
    if code % 10 == NO_INERTIA or not np.isfinite(inertia).all():
        return blown_up(inertia, velocity)
    falling = np.flatnonzero(gears.backward < 0.0).tolist()
    if code % 10 == SEVERAL:
        names = ", ".join(f"'{joints[i]}'" for i in falling)
        most = (gears.inertia / -gears.backward)[falling].min()
        return SimulationError(
            f"the step has several solutions, or none that could be found, with the self-locking "
            f"gears {names}: some turn against rotors too light for what their gears lock. Let the "
            "gears yield, as real teeth do (`stiffness`): with stiffness dt^2 / 4 + damping dt "
            f"below {most:.3g} kg m^2 every step has one solution. Or give them more rotor "
            "inertia, or backward efficiencies nearer to zero."
        )
    return SimulationError(
        "a step has no solution. Usual causes: a contact target that the joints cannot reach (a "
        "limit and the ground in conflict), or a self-locking gear whose falling branch leaves no "
        "solution; shorten the step or change the state."
    )


def blown_up(inertia: FloatArray, velocity: FloatArray) -> SimulationError:
    """Return the error for a step whose inertia was good once and is no longer.

    Args:
        inertia: H_l (n, n).
        velocity: v (n,) before the step.
    """
    with np.errstate(all="ignore"):
        energy = 0.5 * float(velocity @ inertia @ velocity)
        fastest = float(np.abs(velocity).max(initial=0.0))
    numbers = "the step has no numbers: " if np.isnan(velocity).any() else ""
    return SimulationError(
        f"{numbers}the state has blown up: {energy:.3g} J of kinetic energy, fastest coordinate "
        f"{fastest:.3g} rad/s (m/s). Look at the events of the steps before, and at the torques."
    )


def check_outside(setup: Setup, gap: FloatArray) -> None:
    """Refuse a start inside the ground or beyond a joint limit.

    Args:
        setup: the plant's.
        gap: of the barriers that do not yield, (2 j + c,) at most.

    Raises:
        SimulationError: an overlap beyond TOUCH; it names the place and the depth.
    """
    depth = -float(gap.min(initial=0.0))
    if depth <= TOUCH:
        return
    place = int(np.argmin(gap))
    where = setup.barriers.names[place]
    beyond = f"{depth:.3g} rad (m) beyond its stop"
    inside = f"{1e3 * depth:.3g} mm inside the ground"
    raise SimulationError(
        f"the start of '{setup.robot.name}' overlaps: {where} is "
        f"{beyond if place < setup.barriers.limits else inside}. Place the robot outside, or "
        "let the plant do it: plant.state(position, lifted=True)."
    )
