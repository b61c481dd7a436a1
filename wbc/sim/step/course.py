"""The course of one step: smooth parts, and the impacts between them, until its time is over."""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.compiled import Flags, OutFlags, OutRow, Row, compiled
from wbc.sim.barriers import TOUCH
from wbc.sim.setup import Setup
from wbc.sim.state import SimState
from wbc.sim.step.flow import Flow, PartInput, flow
from wbc.sim.step.impacts import Impact, settle

_TRIES = 40


class Course:
    """What a step has done so far, and what is left of it.

    Attributes:
        state: at the end of what is done.
        left: of the step [s].
        over: whether all of it is done.
        parts, impacts: what is done.
        kept: (2 j + c,) barriers that are rows of what is left of the step: they may close within
            it, but not be passed.
        keeps: whether there are any.
        struck: (2 j + c,) barriers that were reached within the step.
        slow: (2 j + c,) barriers that land too slowly for a part of their own.
    """

    __slots__ = (
        "_command", "_external", "_setup", "_step", "impacts", "keeps", "kept", "left", "over",
        "parts", "slow", "state", "struck",
    )  # fmt: skip

    def __init__(
        self,
        setup: Setup,
        state: SimState,
        command: FloatArray,
        step: float,
        external: FloatArray | None,
    ) -> None:
        """Look which barriers are closed at the start, where the state does not know.

        Args:
            setup: the plant's.
            state: at the start.
            command: (m,) [N m] on the rotors.
            step: h [s].
            external: generalised force (nv,), None for none.

        Raises:
            SimulationError: a start inside the ground or beyond a joint limit.
        """
        self._setup, self._command, self._external = setup, command, external
        self._step = self.left = step
        self.state, self.over, self.keeps = state, False, False
        self.kept = self.slow = self.struck = setup.none
        self.parts: list[Flow] = []
        self.impacts: list[Impact] = []
        if len(state.closed) != setup.barriers.size:
            self.state, impact, fresh = settle(setup, state, step)
            if impact is not None:
                self.impacts, self.struck = [impact], fresh

    def flow_on(self) -> None:
        """Flow smoothly to the end of the step, or to the next touchdown."""
        part = self._flow(self.left)
        while part.landed:
            landing, start = (
                np.empty_like(self.kept),
                self._setup.gaps(self.state.position),
            )
            if self._lands_slowly(part, start, landing):
                self.slow = self.slow | landing
                self._keep(landing)
            else:
                found, jumped = self._until_landing(part, start)
                if jumped is not None:
                    self._keep(jumped)
                if found is not None:
                    part = found
                    break
            part = self._flow(self.left)
        self.parts.append(part)
        self.left -= part.state.time - self.state.time
        self.state, self.over = part.state, self.left <= 1e-9 * self._step

    def take_impact(self) -> None:
        """Stop at the barriers that the part before has reached.

        A kept row closes at some speed, which an impact is to take: at the end of the step for
        all, and before it for those that close faster than what is left of it can stop.
        """
        if self.over and not self.keeps:
            return
        setup, state, rows = self._setup, self.state, None
        again = self.struck is not setup.none
        if self.keeps:
            state = state.replace(closed=state.closed & ~self.kept)
            rows = None if self.over else self.kept
        springy = ~(self.struck | self.slow) if setup.restitution > 0.0 else None
        following = self._step if self.over else self.left
        self.state, impact, fresh = settle(setup, state, following, springy, rows)
        self.impacts += [impact] if impact is not None else []
        if again:
            self._keep(self.struck & fresh)
        self.struck = self.struck | fresh if again else fresh

    def _keep(self, more: BoolArray) -> None:
        """Keep barriers (2 j + c,) as rows of what is left of the step."""
        self.kept = self.kept | more
        self.keeps = bool(self.kept.any())

    def _flow(self, step: float) -> Flow:
        return flow(
            PartInput(self._setup, self.state, self._command, step, self._external, self.kept)
        )

    def _lands_slowly(self, part: Flow, start: FloatArray, landing: BoolArray) -> bool:
        """Write which barriers land; return whether only points do, and all of them slowly.

        Slow is what gravity gives within the step, g h: a step changes speeds by that much anyway,
        so such a landing needs no part of its own. With a restitution e, slow is also no more than
        g h (1 - e) / (2 e), from which on all bounces would be over within the step.
        """
        setup = self._setup
        springy = 2.0 * setup.restitution
        share = min(1.0, (1.0 - setup.restitution) / springy) if springy > 0.0 else 1.0
        short, limits = share * setup.gravity * self.left**2, setup.barriers.limits
        held = self.kept | setup.yielding
        how = landing_of(self.state.closed, held, start, part.gap, limits, short, landing)
        return how == SLOW

    def _until_landing(self, part: Flow, start: FloatArray) -> tuple[Flow | None, BoolArray | None]:
        """Return the flow that ends where the first barrier is reached (regula falsi).

        Gaps are parabolas of the length of a part but for what is of third order, and the speeds
        at the start are known: the first try is enough, unless a gap jumps.

        The whole part where none is. A gap may jump with the length of the part, for example
        where a contact lets go and is no longer pulled back. There is no place of landing then.
        The flow ends before the jump, or is None where that is at once. The second value says
        which barriers (2 j + c,) jump; it is None where there is a place of landing.
        """
        closed, kept, before = self.state.closed, self.kept | self._setup.yielding, None
        ahead, gap_early, gap_late = np.empty((3, len(start)))
        nearest(closed, kept, start, start, gap_early)
        if not nearest(closed, kept, start, part.gap, gap_late) < 0.0:
            return part, None  # What overlaps now did so at the start and is moving out.
        early, late = 0.0, self.left
        fall = late * self._setup.opening(self.state.position, self.state.velocity, start)
        for i in range(_TRIES):
            # Every third try halves, lest one end of the interval never move.
            share = 0.5 if i % 3 == 2 else first_crossing(gap_early, gap_late, fall, i == 0)
            trial = early + share * (late - early)
            part = self._flow(trial)
            least = nearest(closed, kept, start, part.gap, ahead)
            if abs(least) <= 0.5 * TOUCH:
                return part, None
            if least > 0.0:
                early, before = trial, part
                ahead, gap_early = gap_early, ahead
            else:
                late = trial
                ahead, gap_late = gap_late, ahead
        return before, gap_late < 0.0


FAST, SLOW = range(2)


@compiled(counted=False)
def landing_of(
    closed: Flags, kept: Flags, start: Row, end: Row, limits: int, short: float, landing: OutFlags
) -> int:
    """Write which barriers land; return SLOW where only points do, none from farther than `short`.

    Args:
        closed, kept: (2 j + c,) barriers that hold already.
        start, end: (2 j + c,) gaps.
        limits: 2 j, of the joint limits, which come first.
        short: [m].
        landing: (2 j + c,) to write.
    """
    found, slowly = False, True
    for i in range(len(end)):
        landing[i] = not closed[i] and not kept[i] and end[i] < -TOUCH
        if landing[i]:
            found = True
            slowly = slowly and i >= limits and start[i] - end[i] <= short
    return SLOW if found and slowly else FAST


@compiled(counted=False)
def nearest(closed: Flags, kept: Flags, start: Row, gap: Row, ahead: OutRow) -> float:
    """Write gaps (2 j + c,) of the barriers ahead, infinite for others; return the least.

    An overlap at the start is on its way out; what is written counts from there.
    """
    least = np.inf
    for i in range(len(gap)):
        ahead[i] = np.inf if closed[i] or kept[i] else gap[i] - min(start[i], 0.0)
        least = min(least, ahead[i])
    return least


@compiled(counted=False)
def first_crossing(early: Row, late: Row, fall: Row, bent: bool) -> float:
    """Return the share of the way at which the first gap closes.

    Args:
        early, late: (2 j + c,) gaps at both ends of the way.
        fall: (2 j + c,) by which they would change on it at the speeds of its start.
        bent: whether they are parabolas that start like that, else straight lines.
    """
    first = 1.0
    for i in range(len(late)):
        if late[i] < 0.0:
            gap = max(early[i], 0.0)
            along = fall[i] if bent else late[i] - gap
            bend = late[i] - gap - along
            root = sqrt(max(along * along - 4.0 * bend * gap, 0.0))
            if along > 0.0:
                first = min(first, 0.5 * (along + root) / -bend)
            else:
                first = min(first, 2.0 * gap / max(root - along, 1e-300))
    return min(max(first, 1e-4), 1.0 - 1e-4)
