"""Closed-form dynamics of one or two hanging links, many machines side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.corpus.machine import Link, Machine


class PlanarLinks:
    """Mass matrix and bias of two links that turn about +y, as arrays over lanes.

    A pendulum gets a second joint that carries a unit inertia and moves nothing.
    """

    def __init__(self, machines: Sequence[Machine]) -> None:
        first = [machine.links[0] for machine in machines]
        second = [machine.links[1] if len(machine.links) > 1 else None for machine in machines]
        self._second1 = np.array([_about_joint(link) for link in first])
        self._moment1 = np.array([link.mass * link.com[[0, 2]] for link in first])
        self._mass2 = np.array([link.mass if link else 0.0 for link in second])
        self._second2 = np.array([_about_joint(link) if link else 1.0 for link in second])
        self._moment2 = np.array(
            [link.mass * link.com[[0, 2]] if link else (0.0, 0.0) for link in second]
        )
        self._felt2 = np.array([1.0 if link else 0.0 for link in second])
        self._length = np.array([-link.origin[2] if link else 0.0 for link in second])
        self._field = np.array([machine.gravity[[0, 2]] for machine in machines])

    def terms(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return M (B, 2, 2) and h (B, 2) for q, v (B, 2)."""
        length, field = self._length, self._field
        x2, z2 = self._moment2.T
        c, s = np.cos(q[:, 1]), np.sin(q[:, 1])
        across, along = (
            x2 * c + z2 * s,
            -x2 * s + z2 * c,
        )  # in the first link's frame
        couple = -length * along
        slope = length * across
        mass = np.empty((len(q), 2, 2))
        mass[:, 0, 0] = (
            self._second1 + self._mass2 * length**2 + self._felt2 * self._second2 + 2.0 * couple
        )
        mass[:, 0, 1] = mass[:, 1, 0] = self._felt2 * self._second2 + couple
        mass[:, 1, 1] = self._second2
        whole = q[:, 0] + q[:, 1]
        own = _pull(field, q[:, 0], self._moment1[:, 0], self._moment1[:, 1] - self._mass2 * length)
        outer = _pull(field, whole, x2, z2)
        bias = np.empty_like(q)
        bias[:, 0] = 2.0 * slope * v[:, 0] * v[:, 1] + slope * v[:, 1] ** 2 - own - outer
        bias[:, 1] = -slope * v[:, 0] ** 2 - outer
        return mass, bias


def _about_joint(link: Link) -> float:
    return float(link.inertia[1, 1] + link.mass * (link.com[0] ** 2 + link.com[2] ** 2))


def _pull(field: np.ndarray, angle: np.ndarray, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the torque about +y of a field on a first moment of mass (x, z) turned by `angle`."""
    c, s = np.cos(angle), np.sin(angle)
    return field[:, 0] * (-x * s + z * c) - field[:, 1] * (x * c + z * s)
