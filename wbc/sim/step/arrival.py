"""From the middle of a part to its end: half a step on, out of what was overrun."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.arrays import BoolArray, FloatArray
from wbc.sim.ground.barriers import TOUCH, ClosedRows
from wbc.sim.setup import Setup
from wbc.sim.solve.solution import StepSolution
from wbc.sim.step.flight import Middle, arrived_velocity, from_middle
from wbc.sim.step.overlap import (
    CORRECTIONS,
    DRIFT,
    aim_of,
    farthest_off,
    inertia_with_rotors,
    shift_out,
)

_NO_SHIFT = np.zeros(0)


class WayOut(NamedTuple):
    """Along which rows overlaps are taken back.

    Attributes:
        metric: (nv, nv) in which the shift is least.
        held: rows of the closed barriers.
        closed: (2 j + c,) barriers.
        pressed: (l + c,) closed barriers that carry an impulse.
    """

    metric: FloatArray
    held: ClosedRows
    closed: BoolArray
    pressed: BoolArray


@dataclass(frozen=True, eq=False, slots=True)
class End:
    """Where a part ends: q (nq,), v (nv,), gaps, overlaps left, and the shift (nv,) out of them."""

    position: FloatArray
    velocity: FloatArray
    gap: FloatArray
    overlap: FloatArray
    shift: FloatArray


def arrive(
    setup: Setup,
    middle: Middle,
    solution: StepSolution,
    closed: BoolArray,
    held: ClosedRows,
    step: float,
    time: float,
) -> End:
    """Move on to the end of the part, out of what it overran."""
    space, bases, after = setup.space, setup.bases, solution.velocity
    inertia = solution.reduced.program.inertia
    position, carried = from_middle(bases, space, middle, inertia, after, 0.5 * step)
    gap = _gap_at(setup, position, time)
    shift, overlap = _NO_SHIFT, _NO_SHIFT
    drift, pressed = gap[closed], solution.normal_impulse > 0.0
    if farthest_off(-drift, pressed) > DRIFT:
        furthest = setup.return_speed * step
        if drift.min() < -furthest - TOUCH:
            overlap = np.maximum(-gap - furthest, 0.0) * closed
        way_out = WayOut(inertia_with_rotors(setup.drive, inertia), held, closed, pressed)
        position, gap, shift = _taken_back(setup, way_out, position, gap, furthest, time)
    velocity = arrived_velocity(bases, space, carried, after)
    return End(position, velocity, gap, overlap, shift)


def _taken_back(
    setup: Setup,
    way_out: WayOut,
    position: FloatArray,
    gap: FloatArray,
    furthest: float,
    time: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return q (nq,), gaps (2 j + c,) and the shift (nv,) after overlaps are taken back."""
    closed, pressed, shift = way_out.closed, way_out.pressed, np.zeros(setup.space.model.nv)
    aim, off = aim_of(gap[closed], furthest, pressed), np.inf
    for _ in range(CORRECTIONS):
        further = shift_out(way_out.metric, way_out.held, aim - gap[closed], pressed)
        moved = pin.integrate(setup.space.model, position, further)
        reached = _gap_at(setup, moved, time)
        before, off = off, farthest_off(aim - reached[closed], pressed)
        if not off < before:  # Ground with edges: the rows lead astray.
            _gap_at(setup, position, time)
            break
        position, gap, shift = moved, reached, shift + further
        if off <= DRIFT:
            break
    return position, gap, shift


def _gap_at(setup: Setup, position: FloatArray, time: float) -> FloatArray:
    """Return all gaps at q (nq,) and a time [s]; the workspace then stands there."""
    model, data = setup.space.model, setup.space.data
    if setup.bases:
        pin.crba(model, data, position, pin.Convention.WORLD)
    else:
        pin.forwardKinematics(model, data, position)
    return setup.barriers.clearance(position, time).gap
