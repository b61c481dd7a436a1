"""Contact forces that no sensor measured: eliminated from the rows that a model is judged by.

A force f at the active contacts adds J' f to every row of the equation of motion. The rows of the
undriven base hold no motor, so they tell f as far as J_u' does:

    f = pinv(J_u') w + Z z,     w the wrench that the base lacks,   J_u' Z = 0.

What is left of w lies in the null space of the contacts. Internal forces Z z move no base, so only
motors feel them: z is what leaves least at the motors' outputs, and the rest is judged.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.dynamics import contact_jacobians
from wbc.robot import Robot

_RANK = 1e-3  # of the largest singular value: directions below it are not told by the base


@dataclass(frozen=True, eq=False)
class ContactBalance:
    """The active contacts of one log without force sensors, k force components together.

    Attributes:
        push: J' (N, nv, k), zero while a contact is not active.
        from_base: (N, k, b) forces per wrench that the base lacks.
        inner: (N, k, m) internal forces per torque left at the motors' outputs; None where there
            are none, or none that a motor feels.
        unseen: (N, m, m) share of the torque at the motors' outputs that internal forces hide;
            None with `inner`.
        seen_share: (m + b,) mean share of every row that no contact force can be.
    """

    push: FloatArray
    from_base: FloatArray
    inner: FloatArray | None
    unseen: FloatArray | None
    seen_share: FloatArray

    @classmethod
    def of(
        cls, robot: Robot, position: FloatArray, active: Mapping[str, BoolArray]
    ) -> ContactBalance:
        """Return the balance along positions q (N, nq).

        Args:
            robot: whose contacts these are.
            position: q (N, nq).
            active: contact name -> (N,) whether it touches.
        """
        parts = [
            contact_jacobians(robot, position, name).transpose(0, 2, 1) * touches[:, None, None]
            for name, touches in active.items()
        ]
        push = np.concatenate(parts, axis=2)
        from_base = np.asarray(
            np.linalg.pinv(push[:, robot.unactuated], rcond=_RANK), dtype=np.float64
        )
        told = from_base @ push[:, robot.unactuated]
        base = 1.0 - np.einsum("nbk,nkb->b", push[:, robot.unactuated], from_base) / len(position)
        gears = np.ones(robot.transmission.size)
        free = np.eye(push.shape[2]) - told
        felt = robot.transmission.topology.T @ push[:, robot.actuated] @ free
        size = float(np.max(np.abs(push), initial=0.0))
        felt[np.abs(felt) < 1e-9 * size] = 0.0
        if not felt.any():
            return cls(push, from_base, None, None, np.concatenate([gears, base]))
        back = np.linalg.pinv(felt, rcond=_RANK)
        unseen = felt @ back
        gears = gears - np.einsum("nii->i", unseen) / len(position)
        seen = np.concatenate([gears, base])
        return cls(push, from_base, free @ back, unseen, seen)

    def carried(self, wrench: FloatArray) -> FloatArray:
        """Return J' f (N, nv) of the forces that carry what the base lacks, wrench (N, b)."""
        force = np.einsum("nkb,nb->nk", self.from_base, wrench)
        return np.asarray(np.einsum("nvk,nk->nv", self.push, force))

    def squeezed(self, output: FloatArray) -> FloatArray:
        """Return J' f (N, nv) of the internal forces behind torque (N, m) left at the outputs."""
        if self.inner is None:
            return np.zeros(self.push.shape[:2])
        force = np.einsum("nkm,nm->nk", self.inner, output)
        return np.asarray(np.einsum("nvk,nk->nv", self.push, force))

    def seen(self, output: FloatArray) -> FloatArray:
        """Return what of torque (N, m) at the motors' outputs no internal force can be."""
        if self.unseen is None:
            return output
        return np.asarray(output - np.einsum("nij,nj->ni", self.unseen, output))
