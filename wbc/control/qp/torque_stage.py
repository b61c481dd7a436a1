"""The rotor-torque program: realising the output torques through the gears."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.drivetrain import GearModel
from wbc.control.qp.gear_rows import place_slopes
from wbc.control.qp.problem import QPProblem
from wbc.control.qp.solvers import solve
from wbc.control.settings import ControllerSettings
from wbc.control.tick import CLIPPED, MESH, OUTPUT, SHARE, SIGMA, TORQUE_ROW


def bend_torques(drivetrain: GearModel, settings: ControllerSettings, block: FloatArray) -> None:
    """Bend the torques of a tick so that the limits leave all of them.

    With t = w + d, w inside the interval that transmits T exactly and d what the limits force the
    gear to miss,

        min  1/2 |D^-T (d / e)|^2 + eps/2 |w + d - t_wanted|^2
        s.t. interval_low <= w <= interval_high,  lower <= w + d + rotor share <= upper

    t_wanted being the blended mesh law. Where t_wanted itself is inside the limits it is the
    solution (zero cost), and for serial drives the program falls apart into clipping each gear;
    only coupled gears that hit a limit need the solver. What clipping costs is weighed at the
    joints, behind the topology D, where it disturbs the motion.

    Args:
        drivetrain: the gears and their limits.
        settings: of the controller.
        block: the rows of the gears of a tick (9, m), of which those of t and N tau_phi are
            written.
    """
    torque, share, gears = block[CLIPPED], block[SHARE], drivetrain.memory
    if not drivetrain.serial:
        problem, m = _coupled(drivetrain, block), len(share)
        tolerance, most = settings.tolerance, settings.max_iterations
        x = solve(settings.solver, problem, tolerance=tolerance, most=most).x
        mesh = x[:m] + x[m:]
        if not np.isfinite(mesh).all():
            mesh = block[MESH]
        torque = np.minimum(np.maximum(mesh + share, gears.lower), gears.upper)
    block[TORQUE_ROW], block[MESH] = torque, torque - share


def _coupled(drivetrain: GearModel, block: FloatArray) -> QPProblem:
    """Return the program in x = [w, d]."""
    gears, output, sigma, share = drivetrain.memory, block[OUTPUT], block[SIGMA], block[SHARE]
    m = len(output)
    positive, negative = np.empty(m), np.empty(m)
    place_slopes(gears, sigma, positive, negative)
    slope = np.where(output > 0.0, positive, negative)
    loss = gears.from_joints.T / np.where(np.abs(slope) > 1e-3, slope, 1e-3)
    both = np.hstack([np.eye(m), np.eye(m)])
    H = 1e-6 * both.T @ both
    H[m:, m:] += loss.T @ loss
    low, high = drivetrain.law.interval(output, sigma)
    return QPProblem(
        H=H,
        g=-1e-6 * both.T @ block[MESH],
        A=np.zeros((0, 2 * m)),
        b=np.zeros(0),
        C=np.vstack([np.eye(m, 2 * m), both]),
        lower=np.concatenate([low, gears.lower - share]),
        upper=np.concatenate([high, gears.upper - share]),
    )
