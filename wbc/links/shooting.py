"""Links behind gears that yield along a log: their likeliest motion, bouncing ones in windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.links.driven_links import DrivenLinks, LinkResponse, Motions
from wbc.transmission import Flanks

_WINDOW = 0.3  # [s] after which a motion is compared with the log again
_CORRECTED = 0.03  # share of a typical state by which a window may begin elsewhere than the last
_STEPS = 6  # of Gauss-Newton, at most, where nothing is known of the starts; beside others one
_VARIED = 1e-3  # of a typical state, for derivatives
_SHARES = (1.0, 0.4, 0.1)  # shares of a step that are tried
_PROMISING = 0.999  # of what is left, above which a step is the last
_COARSE = 4.0  # times the usual time steps, where many gears are compared
_SLACK = 1e-9  # [N m/rad] below which a flank holds nothing
_FAR = 1e100  # [N m] left by a link that flies off
_APART = 3  # windows so far apart are filtered together: filters mix neighbours alone
_RIDGE = 1e-9  # of the largest information


@dataclass(frozen=True, eq=False)
class Deflections:
    """How links moved relative to their motors.

    Attributes:
        paths: of each link (N, 3): deflection, rate, second derivative; where any of the links has
            dry friction a fourth column is that [N m]. Not finite where a link flies off.
        starts: deflections and rates (W, 2, n) with which the windows of the log began.
    """

    paths: list[FloatArray]
    starts: FloatArray
    _shots: _Shots

    @property
    def finite(self) -> bool:
        """Whether every link stayed behind its gear."""
        return all(bool(np.isfinite(path).all()) for path in self.paths)

    @property
    def largest(self) -> float:
        """The largest deflection [rad]."""
        return max(float(np.abs(path[:, 0]).max()) for path in self.paths)

    def change(self, before: Deflections) -> float:
        """Return by how much any deflection differs [rad]."""
        pairs = zip(self.paths, before.paths, strict=True)
        return max(float(np.abs(now[:, 0] - then[:, 0]).max()) for now, then in pairs)

    def at(self, first: IntArray) -> FloatArray:
        """Return deflections and rates (W, 2, n) at the first samples of windows.

        Windows are one where no gear has play, and more behind play.
        """
        if len(first) == len(self.starts):
            return self.starts
        return np.stack([path[first, :2] for path in self.paths], axis=-1)

    @cached_property
    def _around(self) -> _Around:
        return self._shots.around(self.starts)


def deflections(
    responses: Sequence[LinkResponse],
    gears: Sequence[Flanks],
    near: Deflections | None = None,
    *,
    straight: bool = False,
    rough: bool = False,
) -> Deflections:
    """Return the motion of n links together (`DrivenLinks.follow`), from the likeliest starts.

    How the links moved when the log began is in no channel: it is where least is left of the log.

    A link that bounces forgets how it began: motions that differ by 1e-12 differ by the whole play
    seconds later, so that what one start leaves of a log has a valley at every strike. So behind
    play the log is cut into windows (multiple shooting; H. G. Bock, 1983): each begins close to
    where the last one ends, and all begin where least is left of the log. In what is left then
    there is one valley, and rounding is forgotten.

    Args:
        responses: of the links along one log, under the same load.
        gears: in front of them.
        near: motion with numbers close by, from whose starts one step is made; None where nothing
            is known.
        straight: for derivatives: what other starts change is taken from `near`, a motion that was
            returned here.
        rough: to compare many gears: longer time steps, and one step to the likeliest starts. What
            14 springs and 16 widths of play leave of a practice log changes by at most 13 and 27 %,
            that of the best by 1 %, in a tenth of the time.
    """
    links = DrivenLinks.of(responses, gears, _COARSE if rough else 1.0)
    shots = _Shots.of(responses, links)
    # Where the links of a trial fly off, so do its numbers: it leaves infinity, and loses.
    with np.errstate(over="ignore", invalid="ignore"):
        if near is None:
            starts, moved = shots.likeliest(rough)
        elif straight:
            starts, moved = shots.beside(near._around)
        else:
            starts, moved = shots.settled(near.at(shots.first), 1)
    columns = [moved.d, moved.v, moved.a] + [moved.dry] * links.rubs
    paths = list(np.stack(columns, axis=-1)[:, :, 0].transpose(1, 0, 2))
    return Deflections(paths, starts, shots)


@dataclass(frozen=True, eq=False)
class _Around:
    """How links move from K = W 2 n starts close by.

    Attributes:
        shots: the log.
        starts: (W, 2, n) in whose neighbourhood.
        moved: from them, and with each number of all windows varied.
        left: (R,) of the log by the first.
        slopes: (R, K) change of it per size of the starts.
        ties: (K, K) change of the jumps.
        gram: (K, K) of both.
        scatter: squared, of what is left: how much the jumps weigh.
    """

    shots: _Shots
    starts: FloatArray
    moved: Motions
    left: FloatArray
    slopes: FloatArray
    ties: FloatArray
    gram: FloatArray
    scatter: float

    def step(self, left: FloatArray, jumps: FloatArray) -> FloatArray:
        """Return the step (W, 2, n) of least squares, in sizes, from (R,) left and (K,) jumps."""
        moment = self.slopes.T @ left + self.scatter * (self.ties.T @ jumps)
        return np.asarray(np.linalg.solve(self.gram, -moment)).reshape(self.starts.shape)

    def after(self, moved: Motions, step: FloatArray) -> Motions:
        """Return a motion with the change that a step, in sizes, of the starts makes."""

        def changed(values: FloatArray, around: FloatArray, own: FloatArray) -> FloatArray:
            slopes = (around[..., 1:] - around[..., :1]) / _VARIED
            return np.asarray(values + np.einsum("i...s,is->i...", slopes, own)[..., None])

        own = step.reshape(len(step), -1)
        rows = [own[self.shots.window]] * (len(moved) - 1) + [own]  # the ends are of the windows
        return Motions(*map(changed, moved, self.moved, rows))


@dataclass(frozen=True, eq=False)
class _Shots:
    """A log that is cut into windows.

    Attributes:
        responses: of the n links.
        links: what drives them.
        first: (W,) number of the first sample of each window.
    """

    responses: Sequence[LinkResponse]
    links: DrivenLinks
    first: IntArray

    @classmethod
    def of(cls, responses: Sequence[LinkResponse], links: DrivenLinks) -> _Shots:
        """Return a log in windows where links bounce, else in one."""
        hop = max(8, int(_WINDOW / links.step))
        count = max(1, len(links.load) // hop) if links.bounces else 1
        return cls(responses, links, hop * np.arange(count))

    @cached_property
    def size(self) -> FloatArray:
        """(1, 2, n) deflections and rates as large as a gear's play and wind-up allow.

        A soft or heavily damped gear is far from wound up when a window ends: it gets no further
        than its damping and the link's inertia let it.
        """
        links, gears = self.links, self.links.gears
        load, inertia = np.abs(links.load).max(axis=0), np.diagonal(links.inertia.mean(axis=0))
        half = np.array([0.5 * gear.play for gear in gears])
        held = np.array([gear.stiffness + gear.damping / _WINDOW for gear in gears])
        away = half + 0.5 * load / (held + 2.0 * inertia / _WINDOW**2)
        return np.stack([away, np.sqrt(load * away / inertia)])[None]

    def likeliest(self, rough: bool) -> tuple[FloatArray, Motions]:
        """Return starts (W, 2, n) where nothing is known, and the motion from them.

        They are looked for from links at rest, wound up by their loads on either flank. A `rough`
        search ends after one step. Else, as some windows then end in valleys of their own, these go
        on from where the last one ended, where that leaves less.
        """
        load, places = self.links.load[self.first], []
        for gear, torque in zip(self.links.gears, load.T, strict=True):
            far = -torque / max(gear.stiffness, _SLACK) - np.sign(torque) * 0.5 * gear.play
            places.append((far, -far) if gear.play > 0.0 else (far,))
        wound = np.stack([np.stack(sides, axis=1) for sides in product(*places)], axis=-1)
        offers = np.stack([wound, np.zeros_like(wound)], axis=1)
        first = starts, moved = self.settled(self._least(offers), 1 if rough else _STEPS)
        if len(starts) == 1 or rough:
            return first
        carried = np.concatenate([starts[:1], moved.ends[:-1, ..., 0]])
        second = self.settled(self._least(np.stack([starts, carried], axis=-1)), _STEPS)
        return min(first, second, key=lambda end: float(np.sum(self._left(end[1]) ** 2)))

    def _least(self, offers: FloatArray) -> FloatArray:
        """Return of some starts (W, 2, n, S) those that leave least in each window (W, 2, n)."""
        if offers.shape[-1] == 1:
            return offers[..., 0]
        best = np.argmin(self._squares(self._left(self._follow(offers))), axis=0)
        return _chosen(offers, best)[..., 0]

    def settled(self, starts: FloatArray, steps: int) -> tuple[FloatArray, Motions]:
        """Return starts (W, 2, n) from which less is left, and the motion from them.

        With s the starts, r(s) what is left and e(s) the ends of the windows, least squares of

            r(s), scatter (s_0 - given) / size, scatter (s_w - e_w-1) / (_CORRECTED size)

        by Gauss-Newton; the scatter is that of r after a step without the other rows. A window
        hardly feels others but its neighbours, so that each takes the share of its step that leaves
        least in and beside it. Behind springs one step is all: the motion is linear in its start.
        """
        given = starts[:1]
        for _ in range(steps):
            around = self.around(starts)
            moved = Motions(*(values[..., :1] for values in around.moved))
            jumps = self._jumps(starts[..., None], given, moved)
            step = around.step(around.left, jumps.ravel())
            if not np.isfinite(step).all():
                break
            if not self.links.bounces and not self.links.rubs:
                return starts + self.size * step, around.after(moved, step)
            shares = (self.size * step)[..., None] * np.array(_SHARES)
            offers = starts[..., None] + np.concatenate([0.0 * shares[..., :1], shares], axis=-1)
            tried = [moved, self._follow(offers[..., 1:])]
            tried_all = Motions(*(np.concatenate(v, axis=-1) for v in zip(*tried, strict=True)))
            cost, own = self._cost(offers, given, tried_all, around.scatter)
            which = np.argmin(own, axis=0)
            chosen = _chosen(offers, which)
            after = self._one_of(tried_all, which)
            gained, _ = self._cost(chosen, given, after, around.scatter)
            if not gained[0] < cost[0]:
                break
            starts, moved = chosen[..., 0], after
            if gained[0] > _PROMISING * cost[0]:
                break
        return starts, moved

    def beside(self, around: _Around) -> tuple[FloatArray, Motions]:
        """Return starts and motion one step from those of other numbers, by their derivatives."""
        shots, starts = replace(self, first=around.shots.first), around.starts
        moved = shots._follow(starts[..., None])
        jumps = around.shots._jumps(starts[..., None], starts[:1], moved)
        step = around.step(shots._left(moved)[:, 0], jumps.ravel())
        return starts + around.shots.size * step, around.after(moved, step)

    def _follow(self, starts: FloatArray) -> Motions:
        return self.links.follow(self.first, starts)

    def _one_of(self, moved: Motions, which: IntArray) -> Motions:
        """Return one of S motions: in each window the one that is chosen there (W,)."""
        each = which[self.window]
        parts = moved.d, moved.v, moved.reached, moved.rubbed, moved.ends
        return self.links.motions(map(_chosen, parts, (each, each, each, each, which)))

    def around(self, starts: FloatArray) -> _Around:
        """Return how the links move from starts (W, 2, n) and from others close by."""
        units = _VARIED * np.eye(self.size.size).reshape(*starts.shape[1:], -1)
        units = np.concatenate([np.zeros_like(units[..., :1]), units], axis=-1)
        moved = self._follow(starts[..., None] + self.size[..., None] * units)
        left, slopes, gram = self._slopes(moved)
        ties = self._ties(moved)
        # Where nothing is left of a start in the log, the smallest step is taken.
        ridge = _RIDGE * max(float(gram.diagonal().max()), _RIDGE) * np.eye(len(gram))
        free = left - slopes @ np.linalg.solve(gram + ridge, slopes.T @ left)
        scatter = float(np.mean(free**2))
        gram = gram + scatter * (ties.T @ ties) + _RIDGE * ridge
        return _Around(self, starts, moved, left, slopes, ties, gram, scatter)

    def _left(self, moved: Motions) -> FloatArray:
        """Return (R,) or (R, S) what motions leave of the log, in the band."""
        torques = self._torques(moved)
        left = [r.left(torques[:, k]) for k, r in enumerate(self.responses)]
        return np.concatenate(left)

    def _torques(self, moved: Motions) -> FloatArray:
        torques = self.links.torques(moved)
        torques[~np.isfinite(torques)] = _FAR
        return torques

    def _squares(self, left: FloatArray) -> FloatArray:
        """Return the squares (S, W), by window, of what is left (R, S)."""
        rows = np.concatenate([self.window[r.rows] for r in self.responses])
        return np.array([np.bincount(rows, column, len(self.first)) for column in left.T**2])

    @cached_property
    def window(self) -> IntArray:
        """(N,) the window of each sample."""
        lengths = np.diff([*self.first, len(self.links.load)])
        return np.repeat(np.arange(len(self.first)), lengths)

    def _jumps(self, starts: FloatArray, given: FloatArray, moved: Motions) -> FloatArray:
        """Return (W, 2 n, S) by how much windows begin elsewhere than the last ended, or given."""
        before = np.concatenate([given[..., None] + np.zeros(starts.shape[3]), moved.ends[:-1]])
        jumps = (starts - before) / (self._share[..., None] * self.size[..., None])
        jumps[~np.isfinite(jumps)] = _FAR
        return np.asarray(jumps.reshape(len(starts), -1, starts.shape[3]))

    @cached_property
    def _share(self) -> FloatArray:
        """(W, 1, 1) share of its size by which a start is expected to be elsewhere."""
        share = np.full((len(self.first), 1, 1), _CORRECTED)
        share[0] = 1.0
        return share

    def _cost(
        self, starts: FloatArray, given: FloatArray, moved: Motions, scatter: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return the squares (S,) of motions, and those in and beside each window (S, W)."""
        left = self._squares(self._left(moved))
        jumps = scatter * np.sum(self._jumps(starts, given, moved) ** 2, axis=1).T
        beside = np.concatenate([jumps[:, 1:], np.zeros((len(jumps), 1))], axis=1)
        return np.sum(left + jumps, axis=1), left + jumps + beside

    def _slopes(self, moved: Motions) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what a motion leaves (R,), its change (R, K) per size of the starts, their Gram.

        A row feels the start of its own window and of those beside it alone.

        Args:
            moved: from the starts, and from each of their 2 n numbers varied in all windows.
        """
        torques = self._torques(moved)
        change = (torques[..., 1:] - torques[..., :1]) / _VARIED
        windows, count = len(self.first), change.shape[2]
        colour = np.arange(min(windows, _APART))
        mine = self.window[:, None] % colour.size == colour
        near = np.arange(windows)[:, None] + colour - colour.size // 2
        near += colour.size * ((near < 0).astype(int) - (near >= windows))
        near = np.take_along_axis(near, np.argsort(near % colour.size, axis=1), axis=1)
        places = (near[..., None] * count + np.arange(count)).reshape(windows, -1)
        gram = np.zeros((windows * count,) * 2)
        left, slopes = [], []
        for k, response in enumerate(self.responses):
            left.append(response.left(torques[:, k, 0]))
            found = -response.band(mine[..., None] * change[:, None, k]).reshape(len(left[-1]), -1)
            whole = np.zeros((len(found), len(gram)))
            ends = np.searchsorted(self.window[response.rows], np.arange(windows + 1))
            for place, begin, end in zip(places, ends[:-1], ends[1:], strict=True):
                rows = found[begin:end]
                whole[begin:end, place] = rows
                gram[np.ix_(place, place)] += rows.T @ rows
            slopes.append(whole)
        return np.concatenate(left), np.concatenate(slopes), gram

    def _ties(self, moved: Motions) -> FloatArray:
        """Return the change (K, K) of jumps per size of the starts."""
        windows, count = len(self.first), self.size.size
        carried = (moved.ends[..., 1:] - moved.ends[..., :1]) / (_VARIED * self.size[..., None])
        carried = np.nan_to_num(carried).reshape(windows, count, count)
        ties = np.zeros((windows, count, windows, count))
        own = np.arange(windows)
        ties[own, :, own] = np.eye(count) / self._share
        ties[own[1:], :, own[:-1]] = -carried[:-1] / _CORRECTED
        return ties.reshape(windows * count, -1)


def _chosen(values: FloatArray, which: IntArray) -> FloatArray:
    """Return of S entries (N, ..., S) the one that is chosen in each row (N,), (N, ..., 1)."""
    each = which.reshape(-1, *(1,) * (values.ndim - 1))
    return np.asarray(np.take_along_axis(values, each, axis=-1))
