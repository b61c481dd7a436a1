"""The rotor-torque program: realising the output torques through the gears."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.output_torques import TorqueTerms
from wbc.control.solvers import QPProblem, make_solver
from wbc.control.torque.blending import place_realised, place_torques
from wbc.control.torque.gears import GearLaw
from wbc.transmission import Transmission


class Realised(NamedTuple):
    """Rotor torques that bring about output torques.

    Attributes:
        torque: N tau_phi (m,) [N m].
        mesh: t (m,) [N m] that enters the meshes.
        exact: whether no limit bent them.
    """

    torque: FloatArray
    mesh: FloatArray
    exact: bool


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
        self, gears: Transmission, law: GearLaw, solver: str, tolerance: float, iterations: int
    ) -> None:
        """Prepare for some gears."""
        self._law = law
        m = gears.size
        self._serial = bool(np.array_equal(gears.topology, np.eye(m)))
        self._to_joints = gears.motor_from_joint.T
        if not self._serial:
            self._solver = make_solver(
                solver, 2 * m, 0, 2 * m, tolerance=tolerance, max_iterations=iterations
            )

    def solve(
        self,
        output: FloatArray,
        share: FloatArray,
        sigma: FloatArray,
        limits: tuple[FloatArray, FloatArray],
    ) -> Realised:
        """Return the rotor torques.

        Args:
            output: T wanted (m,) [N m].
            share: what the rotors take themselves (m,) [N m]: inertia and friction.
            sigma: certainty of the direction of each gear (m,).
            limits: least and greatest N tau_phi (m,).
        """
        m = len(output)
        wanted, torque, clipped = np.empty(m), np.empty(m), np.empty(m)
        slopes = self._law.blended
        if place_torques(output, share, sigma, *slopes, *limits, wanted, torque, clipped):
            return Realised(torque, wanted, True)
        if self._serial:
            return Realised(clipped, clipped - share, False)
        return Realised(*self._coupled(output, wanted, share, sigma, limits), False)

    def realised(
        self, terms: TorqueTerms, sigma: FloatArray, limits: tuple[FloatArray, FloatArray]
    ) -> tuple[FloatArray, FloatArray, Realised | None]:
        """Return T, what the rotors take, and the rotor torques where no limit bends them.

        Args:
            terms: of a solution, see `OutputTorques.terms`.
            sigma, limits: as for `solve`.
        """
        torques = np.empty((5, len(sigma)))
        exact = place_realised(*terms, sigma, *self._law.blended, *limits, torques)
        return torques[0], torques[1], Realised(torques[3], torques[2], True) if exact else None

    def _coupled(
        self,
        output: FloatArray,
        wanted: FloatArray,
        share: FloatArray,
        sigma: FloatArray,
        limits: tuple[FloatArray, FloatArray],
    ) -> tuple[FloatArray, FloatArray]:
        problem = self.problem(output, wanted, share, sigma, limits)
        found = self._solver.solve(problem)
        m = len(output)
        mesh = found.x[:m] + found.x[m:]
        if not np.isfinite(mesh).all():
            mesh = wanted
        torque = np.minimum(np.maximum(mesh + share, limits[0]), limits[1])
        return torque, torque - share

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
        slope = self._law.slopes(sigma).at(output > 0.0)
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
