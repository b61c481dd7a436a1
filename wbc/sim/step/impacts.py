"""Impacts as Python sees them: what barriers that are reached do, and the state after it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.errors import SimulationError
from wbc.mechanics.newton import UNSOLVED, WAYS
from wbc.sim.barriers import TOUCH
from wbc.sim.setup import Setup, copied
from wbc.sim.state import SimState
from wbc.sim.step.arrival import rigid_ones
from wbc.sim.step.impact import (
    CONTACT,
    ENERGY,
    HIT,
    LEFT,
    MESH,
    ROWS_OF,
    SHARE,
    USED,
    WAY,
    impact_at,
    impact_in_rows,
)
from wbc.sim.step.program import (
    StepProgram,
    StepSolution,
    blown_up,
    solve_rows,
    unsolved,
)
from wbc.sim.step.solution import NO_INERTIA, UNDECIDED, solve_part

_NOTHING = np.zeros(0)
_ROUNDING = 1e-9
_TRIES = 5
"""Shares of the restitution tried between none and all; the loss is quadratic in the share while
rows keep to their pieces, so that false position meets it soon."""


@dataclass(frozen=True, eq=False)
class Impact:
    """One impact.

    Attributes:
        setup: the plant's.
        state: just before.
        together: (2 j + c,) barriers that take part.
        record: numbers of `Hit`.
    """

    setup: Setup
    state: SimState
    together: BoolArray
    record: Any

    @property
    def time(self) -> float:
        """[s]."""
        return self.state.time

    @property
    def before(self) -> FloatArray:
        """v (nv,) just before."""
        return self.state.velocity

    @property
    def after(self) -> FloatArray:
        """v (nv,) just after."""
        found: FloatArray = self.record["after"]
        return found

    @property
    def contact_impulse(self) -> FloatArray:
        """(k, 3) [N s] on the robot, world axes."""
        return np.asarray(self.record["pushes"].reshape(-1, 3))

    @property
    def restitution(self) -> float:
        """Normal speed after over before; as much less than the plant's as it would make energy."""
        return float(self.numbers[SHARE]) * self.setup.restitution

    @property
    def numbers(self) -> FloatArray:
        """MESH to LEFT of `wbc.sim.step.impact`."""
        found: FloatArray = self.record["found"]
        return found

    @property
    def mesh_loss(self) -> float:
        """Energy lost in the gears [J]."""
        return float(self.numbers[MESH])

    @property
    def contact_loss(self) -> float:
        """Energy lost in the contacts [J]."""
        return float(self.numbers[CONTACT])

    @property
    def kinetic(self) -> float:
        """Energy before [J], of rotors included."""
        return float(self.numbers[ENERGY])

    @property
    def missed(self) -> float:
        """Speed [m/s, rad/s] by which a passive end misses the laws, else zero."""
        return float(self.numbers[LEFT])

    @cached_property
    def solution(self) -> StepSolution:
        """Of the impact's program, which is put together again."""
        setup, state, numbers = self.setup, self.state, self.numbers
        setup.tell_coupling(state.position, state.velocity)
        setup.tell_motion(state)
        rows, system, inertia = _in_rows(setup, state, self.together, self.record["aims"])
        impulse = self.record["impulse"][: len(rows.places)]
        at = np.ascontiguousarray(state.velocity), np.zeros(len(impulse))
        solve_part(setup.plant, rows, system, *at, 0.0, 1.0, impulse)
        program, used = StepProgram.of(rows, system, inertia), int(numbers[USED])
        return StepSolution(program, system, self.after, impulse, used, WAYS[int(numbers[WAY])])


def _in_rows(setup: Setup, state: SimState, together: BoolArray, aims: FloatArray) -> Any:
    """Return the rows of an impact, their system, and H_l."""
    at = np.ascontiguousarray(state.position), np.ascontiguousarray(state.velocity)
    return impact_in_rows(setup.plant, together, *at, aims[: int(together.sum())])


def settle(
    setup: Setup, state: SimState, left: float, back: FloatArray, kept: BoolArray
) -> tuple[SimState, Impact | None, BoolArray]:
    """Take the impact on barriers that have just been reached.

    A barrier counts as reached where its gap is closed and the state does not know it to be. After
    the impact those stay closed that part so slowly that gravity would bring them back within what
    is left of the step: their rows let them open, and spare them an impact and a part of their own.

    A kept barrier is a row of the rest of the step, and the row acts from the middle on. An impact
    elsewhere must not drive the robot through it before: where it closes faster than 2 gap/left it
    takes part in the impact, and then closes at that speed.

    Args:
        setup: the plant's.
        state: where the robot is.
        left: of the step [s].
        back: (2 j + c,) restitution of the barriers.
        kept: (2 j + c,) barriers that are rows of what is left of the step.

    Returns:
        the state after it, the impact if there was any, and which barriers (2 j + c,) were reached.

    Raises:
        SimulationError: the impact has no solution, or several; or a state whose closed barriers
            are not known starts inside the ground or beyond a joint limit.
    """
    closed, hit, velocity, impact = state.closed, setup.plant.hit, state.velocity, None
    if len(closed) != setup.barriers.size:
        check_outside(setup, setup.gaps(state.position)[: rigid_ones(setup.plant)])
        closed = setup.none
    setup.tell_coupling(state.position, velocity)
    setup.tell_motion(state)
    at = np.ascontiguousarray(state.position), np.ascontiguousarray(velocity)

    def strike(share: float, given: FloatArray = _NOTHING) -> None:
        impact_at(setup.plant, closed, kept, share * back, *at, left, given)
        hit.found[SHARE] *= share

    kind = impact_at(setup.plant, closed, kept, back, *at, left, _NOTHING)
    setup.heard()
    if kind == HIT:
        together = closed | hit.fresh | kept
        if hit.found[SHARE] > 0.0 and hit.found[WAY] <= UNSOLVED:
            _give_less_back(strike, hit.found)
        if hit.found[WAY] >= UNSOLVED:
            _decide(setup, state, together, strike)
        impact = Impact(setup, state, together, copied(setup.hit))
        velocity = impact.after
    following = SimState(
        state.position, velocity, state.time, hit.closed.copy(), state.impulse, state.deflection,
        state.motor_velocity, state.memory,
    )  # fmt: skip
    return following, impact, hit.fresh.copy()


def _decide(
    setup: Setup, state: SimState, together: BoolArray, strike: Callable[..., None]
) -> None:
    """Take an impact with self-locking gears that has several solutions.

    Args:
        setup, state: see `settle`.
        together: (2 j + c,) barriers that take part.
        strike: takes the impact with a share of the restitution, and known impulses.

    Raises:
        SimulationError: the impact has no solution.
    """
    hit, found, inertia = setup.plant.hit, setup.plant.hit.found, setup.plant.placed.inertia
    names = setup.robot.transmission.joints
    if found[WAY] == UNDECIDED:
        for share in (1.0, 0.0):
            strike(share)
            _, system, _ = _in_rows(setup, state, together, hit.aims)
            start, m = np.zeros(len(system.free)), len(names)
            start[:m] = state.impulse[:m] if len(state.impulse) else 0.0
            given, _, _ = solve_rows(system, start, names)
            strike(share, given)
            if found[CONTACT] >= 0.0:
                break
    if found[WAY] >= UNSOLVED:
        if found[WAY] == NO_INERTIA or not np.isfinite(inertia).all():
            raise blown_up(inertia, state.velocity)
        _, system, _ = _in_rows(setup, state, together, hit.aims)
        raise unsolved(system, hit.impulse[: int(found[ROWS_OF])])


def _give_less_back(strike: Callable[[float], None], found: FloatArray) -> None:
    """Take the largest share of the restitution at which an impact makes no energy, by a few tries.

    Args:
        strike: takes the impact with a share, and writes `found`.
        found: numbers MESH to LEFT of `impact`, of the whole restitution.
    """

    def passive() -> bool:
        lost, had = found[CONTACT], found[ENERGY]
        return bool(found[WAY] < UNSOLVED and lost >= -_ROUNDING * had)

    if passive():
        return
    used, high, low = found[USED], 1.0, 0.0
    lost_high = found[CONTACT] if found[WAY] < UNSOLVED else np.nan
    strike(0.0)
    used, lost_low = used + found[USED], found[CONTACT]
    for _ in range(_TRIES if found[WAY] < UNSOLVED else 0):
        share = 0.5 * (low + high)
        if lost_high < 0.0:
            share = low + (high - low) * lost_low / (lost_low - lost_high)
            share = min(max(share, low + 0.1 * (high - low)), high - 0.1 * (high - low))
        strike(share)
        used += found[USED]
        if passive():
            low, lost_low = share, found[CONTACT]
        else:
            high, lost_high = share, found[CONTACT] if found[WAY] < UNSOLVED else np.nan
    strike(low)
    found[USED] += used


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
