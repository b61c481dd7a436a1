"""One log made ready for the model: smoothed motion, measured torques, weights, folds of rows.

The rows that a model is judged by: first the m gears, reported torque minus what mesh, rotor and
drive need. Then the b coordinates that nothing drives: minus the wrench that is missing. Last the
s torque sensors behind gears: measured torque minus what the links need. Where there is a sensor,
the row of its gear starts from what it measures, so that neither row knows of what is wrong on the
other side.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, TypeVar, cast

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.dynamics import contact_torque, inertial_parameters, inertial_regressor
from wbc.dynamics.batch import inverse_dynamics, point_jacobians
from wbc.identification.records.contacts import ContactBalance
from wbc.identification.records.filters import UNKNOWN, WHOLE, Bandwidth, NoiseDensity
from wbc.links import LinkResponse
from wbc.measurement import low_pass
from wbc.robot import Motion, Robot
from wbc.robot.coordinates import output_units as gear_and_base_units

_SMALL = 1e-6
Kept = TypeVar("Kept")


def output_count(robot: Robot) -> int:
    """Return m + b + s."""
    return robot.transmission.size + robot.floating_size + len(robot.torque_sensors)


def output_names(robot: Robot) -> tuple[str, ...]:
    """Return the names (m + b + s,) of the rows."""
    single = {robot.velocity_index(joint): joint for joint in robot.single_joints}
    undriven = [single.get(row, f"base[{row}]") for row in robot.unactuated.tolist()]
    behind = [f"{joint} (link side)" for joint in robot.torque_sensors]
    return (*robot.transmission.joints, *undriven, *behind)


def output_units(robot: Robot) -> tuple[str, ...]:
    """Return the units (m + b + s,) of the rows."""
    units = gear_and_base_units(robot)
    return (*units, *(units[k] for k in robot.sensed))


def output_gear(robot: Robot, output: int) -> int | None:
    """Return the number of the gear that an output belongs to, None for an undriven coordinate."""
    undriven = [None] * robot.floating_size
    gears: list[int | None] = [*range(robot.transmission.size), *undriven, *robot.sensed.tolist()]
    return gears[output]


def output_row(robot: Robot, output: int) -> int:
    """Return the row in v of the coordinate behind an output."""
    rows = robot.actuated, robot.unactuated, robot.actuated[robot.sensed]
    return int(np.concatenate(rows)[output])


def rubbing(robot: Robot) -> IntArray:
    """Return the rows in v of the joints that can rub: the driven ones, then the passive ones."""
    passive = [robot.velocity_index(joint) for joint in robot.passive_joints]
    return np.concatenate([robot.actuated, np.array(passive, dtype=np.int_)])


def at_outputs(robot: Robot, gears: NDArray[Any], passive: NDArray[Any]) -> NDArray[Any]:
    """Return (..., m + b + s) what is known of gears (..., m) and of passive joints (..., p).

    One where nothing can rub: a base.
    """
    undriven = np.ones((*gears.shape[:-1], robot.floating_size), dtype=gears.dtype)
    rows = rubbing(robot)[gears.shape[-1] :]
    undriven[..., np.searchsorted(robot.unactuated, rows)] = passive
    return np.concatenate([gears, undriven, gears[..., robot.sensed]], axis=-1)


@dataclass(frozen=True, eq=False)
class Record:
    """What one log says of a robot, on an even grid.

    As it is read it holds the channels of the log. Prepared, it is in the band of the kinematics,
    with weights and noise.

    Attributes:
        name: of the log.
        robot: the robot that the user believes in; link terms are cached for it.
        motion: q, v, a (N, ...) of the robot. As read there is no acceleration, q of `placeless`
            joints is the integral of the velocity, and all of v is NaN if some joint has none.
        torque: (N, m) rotor torque that the drives reported [N m].
        reported: (m,) whether a drive reports or is told its torque; 0 stands where not.
        currents: (m,) whether that torque is the current that a drive reports.
        sensed: (N, s) torque behind the gears of the robot's torque sensors [N m].
        forces: contact name -> (N, 3) [N], ground on robot.
        active: contact name -> (N,) whether it touches, of contacts without a force sensor.
        rate: [Hz] of this grid.
        inertia: (10 n_links,) what the links had more in this log than `robot` has, None if
            nothing: a payload of this log alone.
        placeless: joints whose position was not measured and changes nothing.
        weight: (N, m + b) between 0 and 1, small where a joint is too slow for its direction to
            be known.
        bandwidth: cut-offs.
        noise: white noise of the sensors.
        certainty: (m + b,) factor of the condensed rows: below 1 where this log is noisier than
            those that the noise floor is taken from; one for all as long as nothing is known of it.
        load_band: (m,) frequency from which on the load of a driven joint is noise [Hz].
    """

    name: str
    robot: Robot
    motion: Motion
    torque: FloatArray
    reported: BoolArray
    currents: BoolArray
    sensed: FloatArray
    forces: Mapping[str, FloatArray]
    active: Mapping[str, BoolArray]
    rate: float
    inertia: FloatArray | None = None
    placeless: tuple[str, ...] = ()
    weight: FloatArray = field(default_factory=lambda: np.zeros(0))
    bandwidth: Bandwidth = WHOLE
    noise: NoiseDensity = UNKNOWN
    certainty: FloatArray = field(default_factory=lambda: np.ones(1))
    load_band: FloatArray = field(default_factory=lambda: np.zeros(0))
    _kept: dict[tuple[str, int], tuple[bytes, Any]] = field(init=False, default_factory=dict)

    def _latest(self, what: str, number: int, key: bytes, make: Callable[[], Kept]) -> Kept:
        """Return what `make` returns, made once as long as it is asked with the same key."""
        known = self._kept.get((what, number))
        if known is None or known[0] != key:
            known = self._kept[what, number] = key, make()
        return cast(Kept, known[1])

    @cached_property
    def stride(self) -> int:
        """Samples between two rows of the residual."""
        return max(1, int(self.rate / (_ROWS_PER_PERIOD * self.bandwidth.residual)))

    @cached_property
    def edge(self) -> int:
        """Samples cut at both ends, where filters have not settled."""
        return min(int(self.rate / self.bandwidth.residual), len(self.torque) // 8)

    @cached_property
    def scale(self) -> FloatArray:
        """What torques (N, m + b) are multiplied by before they are condensed."""
        return self.weight * self.certainty

    @property
    def rows(self) -> int:
        """Number of rows that `condense` returns."""
        return len(range(self.edge, len(self.torque) - self.edge, self.stride))

    def condense(self, values: FloatArray) -> FloatArray:
        """Return weighted, low-passed, thinned `values` (N, m + b, ...) -> (rows, m + b, ...).

        They may be those of the first outputs alone, such as the gears.
        """
        weight = self.scale[:, : values.shape[1]]
        weight = weight.reshape(*weight.shape, *(1,) * (values.ndim - 2))
        return self.condense_driven(values * weight)

    def condense_driven(self, values: FloatArray) -> FloatArray:
        """Return low-passed and thinned `values` (N, ...) -> (rows, ...), without weights."""
        return self.thinned(low_pass(values, self.bandwidth.residual, self.rate))

    def thinned(self, values: FloatArray) -> FloatArray:
        """Return the samples of `values` (N, ...) that belong to the condensed rows."""
        return values[self.edge : len(values) - self.edge : self.stride]

    @cached_property
    def time(self) -> FloatArray:
        """Time since the start of the log of every condensed row, (rows,) [s]."""
        return self.thinned(np.arange(len(self.torque)) / self.rate)

    @property
    def followed(self) -> BoolArray:
        """(m,) whether the torque of a drive is made of a target."""
        feedback = self.motion.feedback_torque
        made = np.zeros_like(self.torque) if feedback is None else feedback
        return np.asarray(made.any(axis=0))

    def narrowed(self, factor: float) -> Record:
        """Return the same record with the residual's band narrowed by `factor`."""
        band = replace(self.bandwidth, residual=factor * self.bandwidth.residual)
        return replace(self, bandwidth=band)

    @cached_property
    def balance(self) -> ContactBalance | None:
        """The active contacts whose forces were not measured, None without any."""
        if not any(touches.any() for touches in self.active.values()):
            return None
        return ContactBalance.of(self.robot, self.motion.position, self.active)

    @cached_property
    def contacts(self) -> FloatArray:
        """J' f of the contact forces, (N, nv): measured, or as the balance of the base asks."""
        torque = contact_torque(self.robot, self.motion.position, self.forces, self._points)
        return self._balanced(torque)

    @cached_property
    def _points(self) -> dict[str, FloatArray]:
        """(N, 6, nv) per contact with a force: most of the time that such a log takes."""
        q = self.motion.position
        return {name: point_jacobians(self.robot, q, name) for name in self.forces}

    def _balanced(self, measured: FloatArray) -> FloatArray:
        """Return J' f (N, nv) with the forces beside the measured ones that carry the links."""
        if self.balance is None:
            return measured
        lacking = (self.links - measured)[:, self.robot.unactuated]
        return measured + self.balance.carried(lacking)

    def motion_of(self, robot: Robot) -> Motion:
        """Return the motion that a robot believes behind the measured one."""
        motion = self.motion
        for effect in reversed(robot.effects):
            motion = effect.true(robot, motion)
        return motion

    def contacts_of(self, robot: Robot) -> FloatArray:
        """Return J' f (N, nv) of the contact forces that a robot believes."""
        if robot.contacts is self.robot.contacts:
            return self.contacts
        touching = self.robot.with_contacts(robot.contacts)
        places = zip(robot.contacts, self.robot.contacts, strict=True)
        same = all(np.array_equal(one.offset, other.offset) for one, other in places)
        points = self._points if same else None
        return self._balanced(contact_torque(touching, self.motion.position, self.forces, points))

    def believing(self, robot: Robot) -> Record:
        """Return the same log for another robot with the same joints."""
        return replace(self, robot=robot)

    def along(self, motion: Motion) -> Record:
        """Return this record for another motion under the same measured forces."""
        return self if motion is self.motion else replace(self, motion=motion)

    @cached_property
    def links(self) -> FloatArray:
        """H_l a + c_l of the believed robot with this log's payload, (N, nv)."""
        motion, model = self.motion, self.model_of(self.robot)
        acceleration = np.asarray(motion.acceleration)
        return inverse_dynamics(model, motion.position, motion.velocity, acceleration)

    def model_of(self, robot: Robot) -> pin.Model:
        """Return a robot's model with this log's payload."""
        if self.inertia is None:
            return robot.model
        model = robot.model.copy()
        for k, more in enumerate(self.inertia.reshape(-1, 10), start=1):
            if more.any():
                total = model.inertias[k].toDynamicParameters() + more
                model.inertias[k] = pin.Inertia.FromDynamicParameters(total)
        return model

    @cached_property
    def load(self) -> FloatArray:
        """What the joints carry (N, nv): of the believed links, or as torque sensors show it."""
        load = self.links - self.contacts
        output = load[:, self.robot.actuated] @ self.robot.transmission.topology
        output[:, self.robot.sensed] = self.sensed
        load[:, self.robot.actuated] = output @ self.robot.transmission.motor_from_joint
        return load

    @cached_property
    def regressor(self) -> FloatArray:
        """Y (N, nv, 10 n_links) of the link parameters."""
        return inertial_regressor(self.robot, self.motion)

    @cached_property
    def felt(self) -> BoolArray:
        """(nv, 10 n_links) which parameters of the links each coordinate feels."""
        return np.asarray(np.any(self.regressor, axis=0))

    def links_of(self, robot: Robot) -> FloatArray:
        """Return H_l a + c_l (N, nv) of a robot that differs from the believed one."""
        if robot.model is self.robot.model:
            return self.links
        numbers, own = (
            np.concatenate([one.model.gravity.linear, inertial_parameters(one)]).tobytes()
            for one in (robot, self.robot)
        )
        if numbers == own:
            return self.links
        # Most causes leave the links as they are: of one screen 254 of 315 calls ask once more.
        return self._latest("links", 0, numbers, lambda: self.believing(robot).links)

    def condensed_regressor(self, output: int, direction: FloatArray) -> FloatArray:
        """Return (rows, 10 n_links) the condensed columns of the links' parameters at one output.

        Args:
            output: number of the output, whose weights and noise count.
            direction: (nv,) what the output feels of the torque that the links need.
        """

        def condensed() -> FloatArray:
            felt = np.einsum("i,nip->np", direction, self.regressor)
            return self.condensed_at(felt, output)

        return self._latest("regressor", output, direction.tobytes(), condensed)

    def condensed_at(self, values: FloatArray, output: int) -> FloatArray:
        """Return `values` (N or only the first of them, ...) condensed as torques at one output."""
        weight = self.scale[: len(values), output].reshape(-1, *(1,) * (values.ndim - 1))
        return self.condense_driven(values * weight)

    def response_of(self, robot: Robot, joint: str) -> LinkResponse:
        """Return how the link behind a gear of a robot reacts to a deflection of the gear."""
        key, row = inertial_parameters(robot).tobytes(), robot.velocity_index(joint)
        return self._latest("response", row, key, lambda: self._reacting(robot, joint))

    def _reacting(self, robot: Robot, joint: str) -> LinkResponse:
        motion, model, row = self.motion, self.model_of(robot), robot.velocity_index(joint)
        unit, position = np.eye(robot.model.nv)[row], np.array(motion.position)
        position[:, robot.position_index(joint)] += _SMALL

        def needed(m: Motion) -> FloatArray:
            torque = inverse_dynamics(model, m.position, m.velocity, np.asarray(m.acceleration))
            return torque - contact_torque(robot, m.position, self.forces)

        here = needed(motion)
        pushed = motion.replace(acceleration=np.asarray(motion.acceleration) + unit)
        faster = motion.replace(velocity=motion.velocity + _SMALL * unit)
        return LinkResponse(
            1.0 / self.rate,
            row,
            here,
            inertia=needed(pushed) - here,
            damping=(needed(faster) - here) / _SMALL,
            stiffness=(needed(motion.replace(position=position)) - here) / _SMALL,
            unexplained=np.zeros(len(here)),
            band=partial(self.condensed_at, output=robot.transmission.index(joint)),
            rows=np.arange(self.edge, len(here) - self.edge, self.stride),
        )


_BLOCKS_PER_LOG = 5
# Of the band, at least: two are independent. With five, 20 generated logs (seed 4242) got the same
# names in 160 s in place of 140 s.
_ROWS_PER_PERIOD = 3.0
_ENOUGH_RUNS = 3
_LONGEST = 4  # share of the shortest log over which residuals are correlated with themselves
_BLOCK_DURATION = 0.5  # [s]; residuals decorrelate within a few periods of the band


def held_out_folds(records: Sequence[Record], repeats: Sequence[tuple[int, int]]) -> IntArray:
    """Return the fold (rows,) of every condensed row.

    With at least three different runs each run is a fold, repeats together; otherwise every run
    is cut into contiguous blocks, because neighbouring rows are not independent. A run that alone
    moves some joint is cut, too: without it nothing would be known of that joint.
    """
    pairs, count = np.array(repeats, dtype=np.int_).reshape(-1, 2).T, len(records)
    graph = coo_array((np.ones(pairs.shape[1]), pairs), (count, count))
    runs, group = connected_components(graph, directed=False)
    weighed, rows = judged(records), [record.rows for record in records]
    per_run = np.array([weighed[group == g].any(axis=0) for g in range(runs)])
    only = (per_run & (per_run.sum(axis=0) == 1)).any(axis=1)
    folds = []
    for g, length in zip(group.tolist(), rows, strict=True):
        parts = _BLOCKS_PER_LOG if only[g] or runs < _ENOUGH_RUNS else 1
        folds.append(g * _BLOCKS_PER_LOG + np.arange(length) * parts // max(length, 1))
    return np.concatenate(folds)


def rows_of_folds(folds: IntArray) -> list[IntArray | slice]:
    """Return the rows of each fold, in order of their numbers; neighbours as a slice.

    A slice of an array is a view of it, where numbers of rows make a copy.

    Args:
        folds: (rows,) number of the fold of every row.
    """
    parts: list[IntArray | slice] = []
    for fold in np.unique(folds):
        rows = np.flatnonzero(folds == fold)
        first, end = int(rows[0]), int(rows[-1]) + 1
        parts.append(slice(first, end) if end - first == rows.size else rows)
    return parts


def time_blocks(records: Sequence[Record]) -> IntArray:
    """Return the block (rows,) of every row; blocks are long against the band of the residual."""
    blocks, first = [], 0
    for record in records:
        duration = max(_BLOCK_DURATION, 4.0 / record.bandwidth.residual)
        count = max(2, int(len(record.torque) / record.rate / duration))
        blocks.append(first + np.arange(record.rows) * count // max(record.rows, 1))
        first += count
    return np.concatenate(blocks)


def rms(values: FloatArray) -> FloatArray:
    """Return the root mean square (...) of `values` (rows, ...)."""
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def block_means(values: FloatArray, blocks: IntArray) -> FloatArray:
    """Return the mean (B,) of `values` (rows,) in every block."""
    total = np.bincount(blocks, values)
    count = np.bincount(blocks)
    return np.asarray(total[count > 0] / count[count > 0])


def explained_by(blocks: IntArray, values: FloatArray) -> float:
    """Return the share of the mean square of `values` (rows,) that the means of blocks explain."""
    squares = np.bincount(blocks, values) ** 2 / np.maximum(np.bincount(blocks), 1)
    return float(squares.sum() / max(float(values @ values), 1e-300))


def by_log(records: Sequence[Record], rows: FloatArray) -> list[FloatArray]:
    """Return the condensed rows (rows, ...) of each log."""
    return np.split(rows, np.cumsum([record.rows for record in records])[:-1])


def bins_of(values: FloatArray, count: int) -> IntArray:
    """Return the bin (rows,) of every value, bins of equal count: fewer where values repeat."""
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, count + 1)[1:-1]))
    return np.searchsorted(edges, values, side="right")


def rows_per_sample(records: Sequence[Record]) -> float:
    """Return how many rows of white noise are one sample: a band B holds 2 B of them a second."""
    samples = [2.0 * r.bandwidth.residual * r.stride / r.rate * r.rows for r in records]
    return sum(record.rows for record in records) / sum(samples)


def correlated_rows(parts: Sequence[FloatArray], white: float) -> FloatArray:
    """Return (outputs,) how many rows of some series count as one independent sample.

    Squares of a series are as certain as those of n / (sum over all lags of rho^2) independent
    rows, rho being its autocorrelation (Bartlett). Lags are summed up to a fourth of the shortest
    series; what white noise adds to that sum is taken away.

    Args:
        parts: series (rows, outputs) of at least four rows.
        white: rows of white noise that are one sample; 0 where nothing is to be taken away.
    """
    longest = max(1, min(map(len, parts)) // _LONGEST)
    chance = longest * white / sum(map(len, parts))
    total = np.zeros((longest + 1, parts[0].shape[1]))
    for part in parts:
        power = np.abs(np.fft.rfft(part, 2 * len(part), axis=0)) ** 2
        total += np.fft.irfft(power, axis=0)[: longest + 1]
    correlation = total / np.maximum(total[0], 1e-300)
    lags = np.maximum(np.sum(correlation[1:] ** 2, axis=0) - chance, 0.0)
    return np.asarray(1.0 + 2.0 * lags)


def judged(records: Sequence[Record]) -> BoolArray:
    """Return (logs, outputs) whether an output has any weight in a log."""
    return np.array([record.weight.any(axis=0) for record in records])


def left_by(columns: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return values (rows, ...) without what columns (rows, n) explain, and how (n, ...)."""
    size = np.sqrt(np.sum(columns**2, axis=0))
    size = np.where(size > 0.0, size, 1.0)
    taken = (np.linalg.lstsq(columns / size, values, rcond=1e-9)[0].T / size).T
    return np.asarray(values - columns @ taken), np.asarray(taken)
