"""Impacts as Python sees them: what barriers that are reached do, and the state after it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.errors import SimulationError
from wbc.mechanics.newton import UNSOLVED, WAYS
from wbc.sim.barriers import TOUCH
from wbc.sim.setup import Setup
from wbc.sim.state import SimState
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
    tolerance_of,
    unsolved,
)
from wbc.sim.step.solution import NO_INERTIA, UNDECIDED

_NOTHING = np.zeros(0)
_ROUNDING = 1e-9
_TRIES = 5
"""Shares of the restitution tried between none and all; the loss is quadratic in the share while
rows keep to their pieces, so that false position meets it soon."""


@dataclass(frozen=True, eq=False)
class Impact:
    """One impact.

    Attributes:
        time: [s].
        before: v (nv,) just before.
        after: v (nv,) just after.
        contact_impulse: (k, 3) [N s] on the robot, world axes.
        restitution: normal speed after over before; the plant's, or as much less as friction
            would otherwise have made energy.
        numbers: MESH to LEFT of `wbc.sim.step.impact`.
        details: returns the solution of the impact's program; called when asked for.
    """

    time: float
    before: FloatArray
    after: FloatArray
    contact_impulse: FloatArray
    restitution: float
    numbers: FloatArray
    details: Callable[[], StepSolution]

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
        """Of the impact's program."""
        return self.details()


def settle(
    setup: Setup,
    state: SimState,
    left: float,
    springy: BoolArray | None = None,
    kept: BoolArray | None = None,
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
        springy: (2 j + c,) barriers that give back the plant's restitution, None for all.
        kept: (2 j + c,) barriers that are rows of what is left of the step, None for none.

    Returns:
        the state after it, the impact if there was any, and which barriers (2 j + c,) were reached.

    Raises:
        SimulationError: a state whose closed barriers are not known starts inside the ground or
            beyond a joint limit.
    """
    closed, ahead = state.closed, setup.none if kept is None else kept
    if len(closed) != setup.barriers.size:
        gap = setup.gaps(state.position)
        check_outside(setup, np.where(setup.yielding, np.inf, gap))
        closed = setup.none
    back = setup.back if springy is None else np.where(springy, setup.back, 0.0)
    setup.tell_coupling(state.position, state.velocity)
    setup.tell_motion(state)
    together = _struck(setup, state, (closed, ahead), back, left)
    hit, velocity, impact = setup.plant.hit, state.velocity, None
    if together is not None:
        velocity, numbers = hit.after.copy(), hit.found.copy()
        known = hit.aims.copy(), hit.impulse[: int(numbers[ROWS_OF])].copy()
        impact = Impact(
            state.time,
            state.velocity,
            velocity,
            hit.pushes.reshape(-1, 3).copy(),
            float(numbers[SHARE]) * setup.restitution,
            numbers,
            partial(_solution, setup, state, together, known, velocity, numbers),
        )
    following = SimState(
        state.position, velocity, state.time, hit.closed.copy(), state.impulse, state.deflection,
        state.motor_velocity, state.memory,
    )  # fmt: skip
    return following, impact, hit.fresh.copy()


def _struck(
    setup: Setup,
    state: SimState,
    barriers: tuple[BoolArray, BoolArray],
    back: FloatArray,
    left: float,
) -> BoolArray | None:
    """Write an impact into `plant.hit`; return which barriers take part, None without an impact.

    Args:
        setup, state, left: see `settle`.
        barriers: (2 j + c,) each, those known to be closed, and rows of what is left of the step.
        back: (2 j + c,) restitution.

    Raises:
        SimulationError: the impact has no solution, or several.
    """
    hit, found, names = setup.plant.hit, setup.plant.hit.found, setup.robot.transmission.joints
    at = np.ascontiguousarray(state.position), np.ascontiguousarray(state.velocity)

    def strike(share: float, given: FloatArray = _NOTHING) -> None:
        impact_at(setup.plant, *barriers, share * back, *at, left, given)
        found[SHARE] *= share

    kind = impact_at(setup.plant, *barriers, back, *at, left, _NOTHING)
    setup.heard()
    if kind != HIT:
        return None
    together = barriers[0] | hit.fresh | barriers[1]
    if found[SHARE] > 0.0 and found[WAY] <= UNSOLVED:
        _give_less_back(strike, found)
    elif found[WAY] == UNDECIDED:
        for share in (1.0, 0.0):
            strike(share)
            aims = hit.aims[: int(together.sum())]
            _, system, _ = impact_in_rows(setup.plant, together, *at, aims, _NOTHING)
            start, m = np.zeros(len(system.free)), len(names)
            start[:m] = state.impulse[:m] if len(state.impulse) else 0.0
            given, _, _ = solve_rows(system, start, names)
            strike(share, given)
            if found[CONTACT] >= 0.0:
                break
    if found[WAY] >= UNSOLVED:
        inertia = setup.plant.placed.inertia
        if found[WAY] == NO_INERTIA or not np.isfinite(inertia).all():
            raise blown_up(inertia, state.velocity)
        aims = hit.aims[: int(together.sum())]
        _, system, _ = impact_in_rows(setup.plant, together, *at, aims, _NOTHING)
        raise unsolved(system, hit.impulse[: int(found[ROWS_OF])], tolerance_of(system))
    return together


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


def _solution(
    setup: Setup,
    state: SimState,
    together: BoolArray,
    known: tuple[FloatArray, FloatArray],
    after: FloatArray,
    numbers: FloatArray,
) -> StepSolution:
    """Return the program of an impact and its solution, from its aims and impulses."""
    setup.tell_coupling(state.position, state.velocity)
    setup.tell_motion(state)
    aims, impulse = known[0][: int(together.sum())], known[1]
    at = np.ascontiguousarray(state.position), np.ascontiguousarray(state.velocity)
    rows, system, inertia = impact_in_rows(setup.plant, together, *at, aims, after)
    program = StepProgram.of(rows, system, inertia)
    return StepSolution(
        program, system, after, impulse, int(numbers[USED]), WAYS[int(numbers[WAY])]
    )


def check_outside(setup: Setup, gap: FloatArray) -> None:
    """Refuse a start inside the ground or beyond a joint limit.

    Args:
        setup: the plant's.
        gap: (2 j + c,).

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
