"""The rotor-torque program: realising the output torques through the gears."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.drivetrain import GearModel
from wbc.control.qp.gear_rows import place_slopes
from wbc.control.qp.problem import QPProblem
from wbc.control.qp.solvers import solve
from wbc.control.tick import CLIPPED, MESH, OUTPUT, SHARE, SIGMA, TORQUE_ROW


class RotorTorqueStage:
    """Finds N tau_phi that bring the wanted output torques to the joints within the limits.

    With t = w + d, w inside the interval that transmits T exactly and d what the limits force the
    gear to miss,

        min  1/2 |D^-T (d / e)|^2 + eps/2 |w + d - t_wanted|^2
        s.t. interval_low <= w <= interval_high,  lower <= w + d + rotor share <= upper

    t_wanted being the blended mesh law. Where t_wanted itself is inside the limits it is the
    solution (zero cost), and for serial drives the program falls apart into clipping each gear;
    only coupled gears that hit a limit need the solver. What clipping costs is weighed at the
    joints, behind the topology D, where it disturbs the motion.
    """

    def __init__(
        self, drivetrain: GearModel, solver: str, tolerance: float, iterations: int
    ) -> None:
        """Prepare for some gears."""
        self._law, self._gears = drivetrain.law, drivetrain.memory
        self._serial, self._to_joints = drivetrain.serial, drivetrain.memory.from_joints.T
        self._solver, self._tolerance, self._most = solver, tolerance, iterations

    def solve(self, block: FloatArray) -> None:
        """Bend the torques of a tick so that the limits leave all of them.

        Args:
            block: the rows of the gears of a tick (9, m), of which those of t and N tau_phi are
                written.
        """
        sigma, output, share = block[SIGMA], block[OUTPUT], block[SHARE]
        limits = self._gears.lower, self._gears.upper
        torque = block[CLIPPED]
        if not self._serial:
            torque = self._coupled(output, block[MESH], share, sigma, limits)
        block[TORQUE_ROW], block[MESH] = torque, torque - share

    def _coupled(
        self,
        output: FloatArray,
        wanted: FloatArray,
        share: FloatArray,
        sigma: FloatArray,
        limits: tuple[FloatArray, FloatArray],
    ) -> FloatArray:
        problem = self.problem(output, wanted, share, sigma, limits)
        found = solve(self._solver, problem, tolerance=self._tolerance, most=self._most)
        m = len(output)
        mesh = found.x[:m] + found.x[m:]
        if not np.isfinite(mesh).all():
            mesh = wanted
        return np.minimum(np.maximum(mesh + share, limits[0]), limits[1])

    def problem(
        self,
        output: FloatArray,
        wanted: FloatArray,
        share: FloatArray,
        sigma: FloatArray,
        limits: tuple[FloatArray, FloatArray],
    ) -> QPProblem:
        """Return the program in x = [w, d]; arguments as for `solve`, `wanted` t (m,)."""
        m = len(output)
        positive, negative = np.empty(m), np.empty(m)
        place_slopes(self._gears, sigma, positive, negative)
        slope = np.where(output > 0.0, positive, negative)
        loss = self._to_joints / np.where(np.abs(slope) > 1e-3, slope, 1e-3)
        H = np.full((2 * m, 2 * m), 0.0)
        H[m:, m:] = loss.T @ loss
        both = np.hstack([np.eye(m), np.eye(m)])
        H += 1e-6 * both.T @ both
        low, high = self._law.interval(output, sigma)
        C = np.zeros((2 * m, 2 * m))
        C[:m, :m] = np.eye(m)
        C[m:] = both
        return QPProblem(
            H,
            -1e-6 * both.T @ wanted,
            np.zeros((0, 2 * m)),
            np.zeros(0),
            C,
            np.concatenate([low, limits[0] - share]),
            np.concatenate([high, limits[1] - share]),
        )
