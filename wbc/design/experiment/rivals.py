"""Rival causes: how they are written, what each predicts for a motion, how far apart they stay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations

import numpy as np
from scipy.optimize import least_squares

from wbc.arrays import FloatArray
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import effect_class
from wbc.errors import DesignError, EffectError
from wbc.identification.records.filters import SPREAD, gate
from wbc.identification.records.preparation import REVERSAL
from wbc.robot import Effect, Motion, Parameter, Robot

Cause = tuple[Effect, ...]
"""Effects that act together; often one."""
_STEP = 1e-4  # of a parameter's typical size, as its own documentation says
_IMPOSSIBLE = 1e6  # misfit in units of the noise, far beyond any that a fit would accept
_DRAWS = 64  # values of a true cause that earlier logs leave open
_SIDES = 1.645  # standard deviations from the middle to the ends of a 90 % interval

BAND = 5.0
"""[Hz] that a diagnosis keeps of a torque, where no diagnosis of the robot says it. It takes 3 to
15 Hz, above which accelerations from the encoders are noisier than the torque; of twelve arms of
the corpus with their sensors, half are kept to less than 5.2 Hz."""

Pair = tuple[int, int]
"""Numbers of the cause that is true and of the one that is fitted in its place."""


def parse_cause(text: str, robot: Robot) -> Cause:
    """Return the cause of `EFFECT@PLACE[:PARAMETER=VALUE,...]`, several joined by `+`.

    Parameters that are left out lie one typical size away from where the effect is not there.

    Raises:
        DesignError: text of another form, or an effect that acts through a soft gear.
        EffectError: an unknown effect, place or parameter.
    """
    return tuple(_effect(part, robot) for part in text.split("+"))


def _effect(text: str, robot: Robot) -> Effect:
    head, _, tail = text.partition(":")
    name, at, where = head.strip().partition("@")
    if not at or not where:
        raise DesignError(f"--between '{text}': use EFFECT@PLACE or EFFECT@PLACE:PARAMETER=VALUE.")
    given: dict[str, float] = {}
    for item in filter(None, tail.split(",")):
        key, _, value = item.partition("=")
        try:
            given[key.strip()] = float(value)
        except ValueError as cause:
            raise DesignError(f"--between '{text}': '{item}' is not PARAMETER=VALUE.") from cause
    kind = effect_class(name)
    typical = typical_values(name, kind.null_values(robot, where))
    effect = kind.at(where, {**typical, **given})
    require_predictable(effect, robot)
    return effect


def typical_values(name: str, null: Mapping[str, float]) -> dict[str, float]:
    """Return the parameters of an effect one typical size away from where it is not there."""
    values = dict(null)
    for parameter in effect_class(name).parameters:
        up = values[parameter.name] + parameter.scale
        inside = up <= parameter.high
        values[parameter.name] = up if inside else values[parameter.name] - parameter.scale
    return values


def require_predictable(effect: Effect, robot: Robot) -> None:
    """Check that the torque of an effect follows from a planned motion.

    Raises:
        DesignError: it does not; a link behind a soft gear follows no plan, and a motor at its
            limit does not either.
        EffectError: the effect cannot sit where it says on this robot.
    """
    gears = robot.with_effect(effect).transmission
    if "drive" in effect.acts_by and "drive_inverse" not in effect.acts_by:
        raise DesignError(
            f"'{effect.name}' shows only where a motor cannot follow, which a planned motion "
            "avoids. Leave it out of --between."
        )
    if np.isfinite(gears.stiffness).any() or np.any(gears.backlash > 0.0):
        raise DesignError(
            f"'{effect.name}' is a soft or loose gear: its link moves as it likes, so that a "
            "planned motion of the motors does not tell its torque. Leave it out of --between."
        )


def parameter_names(cause: Cause) -> tuple[tuple[Effect, Parameter], ...]:
    """Return effect and parameter of every number of a cause, in the order of `widths`."""
    return tuple((effect, parameter) for effect in cause for parameter in effect.parameters)


def cause_numbers(cause: Cause, of: str) -> FloatArray:
    """Return (p,) one of `scale`, `low`, `high` of every number of a cause."""
    return np.array([getattr(parameter, of) for _, parameter in parameter_names(cause)])


def cause_values(cause: Cause) -> FloatArray:
    """Return (p,) the numbers of a cause, in the order of `parameter_names`."""
    return np.array([value for effect in cause for value in effect.values.values()])


@dataclass(frozen=True, eq=False)
class Rivals:
    """Causes of which one is true, on a robot with a gear on every joint.

    A free base is held at rest in the robot's usual pose, by a stand for example, the feet in the
    air. The wrench of the stand acts on the six rows of the base alone, so that the torques of the
    gears are those of the links (Featherstone 2008, chapter 9) and need no force sensor.

    Attributes:
        robot: without any of them.
        causes: with the values at which they are expected; one alone when only its intervals
            are to shrink.
        noise: (m,) standard deviation of the measured rotor torque [N m], white from row to row.
        band: [Hz] that the diagnosis of the log will keep of torques; infinite for all of it.
        covariances: per cause (p, p) of what earlier logs leave open of its parameters, in their
            units; None, or no entry, where there are no such logs: the cause, if true, has its
            values, and as a rival it may take any.
    """

    robot: Robot
    causes: tuple[Cause, ...]
    noise: FloatArray
    band: float = BAND
    covariances: tuple[FloatArray | None, ...] = ()

    def __post_init__(self) -> None:
        """Check what can be compared."""
        if not self.causes or not all(self.causes):
            raise DesignError("an experiment is about one cause or more; give --between.")
        keys = [[effect.key for effect in cause] for cause in self.causes]
        same = len(set(map(frozenset, keys))) < len(keys)
        if same or any(len(set(own)) < len(own) for own in keys):
            raise DesignError("a cause is given twice; an experiment tells different ones apart.")
        passive = self.robot.passive_joints
        if passive:
            raise DesignError(
                f"'{self.robot.name}' has joints without a gear ({', '.join(passive)}): a planned "
                "motion of the motors does not tell where they go. Lock them in robot.toml."
            )
        if not np.all((self.noise > 0.0) & np.isfinite(self.noise)):
            raise DesignError("the noise of the torque must be > 0 and finite; give --noise.")
        if not self.band > 0.0:
            raise DesignError("the band of the diagnosis must be > 0; give --band.")
        for cause, open_part in zip(self.causes, self.covariances, strict=False):
            count = len(parameter_names(cause))
            if open_part is not None and open_part.shape != (count, count):
                raise DesignError(
                    f"the covariance of a cause with {count} parameters must be "
                    f"({count}, {count}), not {open_part.shape}."
                )

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """All ordered pairs of causes."""
        return tuple(permutations(range(len(self.causes)), 2))

    def open_part(self, number: int) -> FloatArray | None:
        """Return (p, p) a square root of what is open of a cause, in typical sizes; None if fixed.

        A parameter that earlier logs do not show is known to one typical size, as before any log.
        """
        found = self.covariances[number] if number < len(self.covariances) else None
        if found is None:
            return None
        scales = cause_numbers(self.causes[number], "scale")
        size, axes = np.linalg.eigh(found / np.outer(scales, scales))
        size = np.maximum(size, 0.0)
        return np.asarray(axes * np.sqrt(size / (1.0 + size)))

    def predictions(self, motion: Motion) -> Predictions:
        """Return what the rivals predict along one motion of the encoders, with its times."""
        return Predictions(self, motion, link_torque(self.robot, motion))


class Predictions:
    """Torques of rivals along one motion; what several of them need is computed once."""

    def __init__(self, rivals: Rivals, motion: Motion, links: FloatArray) -> None:
        """Keep the motion and `link_torque` of the robot without any rival along it.

        With a finite band, and times, only what a diagnosis reads of a torque counts: its low
        frequencies, and no rows about a reversal.
        """
        self.rivals, self.motion, self.links = rivals, motion, links
        time = motion.time
        self._gain: FloatArray | None = None
        self._trust: FloatArray | float = 1.0
        if np.isfinite(rivals.band) and time is not None:
            frequency = np.fft.rfftfreq(2 * len(time), float(time[1] - time[0]))
            # Butterworth's filter of fourth order, forth and back.
            self._gain = np.asarray(1.0 / (1.0 + (frequency / rivals.band) ** 8))
            self._trust = _trust(rivals.robot, motion, 1.0 / (SPREAD * rivals.band))

    def torque(self, cause: Cause) -> FloatArray:
        """Return the rotor torque (N, m) [N m] that the drives report with a cause."""
        base = self.rivals.robot
        robot, motion = base.with_effects(*cause), self.motion
        for effect in reversed(cause):
            motion = effect.true(robot, motion)
        shared = robot.model is base.model and motion is self.motion
        links = self.links if shared else link_torque(robot, motion)
        return rotor_torque(robot, motion, links)[0]

    def _torque_with(self, cause: Cause, values: FloatArray) -> FloatArray:
        """Return the torque (N, m) [N m] with other numbers (p,) of a cause."""
        rest = map(float, values)
        changed = (e.with_values({p.name: next(rest) for p in e.parameters}) for e in cause)
        return self.torque(tuple(changed))

    def in_noise(self, torque: FloatArray) -> FloatArray:
        """Return what is read of torques (N, m, ...), in units of the noise."""
        read = torque.T / self.rivals.noise[:, None]
        if self._gain is not None:
            # Mirrored in time, so that there is no jump at the ends.
            both = np.concatenate([read, read[..., ::-1]], axis=-1)
            low = np.fft.irfft(self._gain * np.fft.rfft(both), both.shape[-1])
            read = low[..., : read.shape[-1]]
        return np.asarray((self._trust * read).T)

    @cached_property
    def expected_torques(self) -> list[FloatArray]:
        """Torque (N, m) of every rival with its expected values."""
        return [self.torque(cause) for cause in self.rivals.causes]

    def peak(self) -> FloatArray:
        """Return the largest torque (N, m) [N m] that any of the rivals asks for."""
        every = [self.torque(()), *self.expected_torques]
        return np.asarray(np.max(np.abs(every), axis=0))

    @cached_property
    def sensitivities(self) -> list[FloatArray]:
        """d torque / d parameter over noise, per typical size, (N m, p) of every rival."""
        return list(map(self._sensitivity, self.rivals.causes, self.expected_torques))

    def _sensitivity(self, cause: Cause, here: FloatArray) -> FloatArray:
        columns = []
        for row, (_, parameter) in enumerate(parameter_names(cause)):
            values = cause_values(cause)
            step = _STEP if values[row] + _STEP * parameter.scale <= parameter.high else -_STEP
            values[row] += step * parameter.scale
            columns.append((self._torque_with(cause, values) - here) / step)
        return self.in_noise(np.stack(columns, axis=2)).reshape(-1, len(columns))

    def distance(self, pair: Pair) -> float:
        """Return the expected log-odds of one cause, if true, over another one that is refitted.

        Half the squared misfit that is left [nats], each row in units of its noise.
        """
        true, other = pair
        target, cause = self.expected_torques[true], self.rivals.causes[other]
        scales, low, high = (cause_numbers(cause, of) for of in ("scale", "low", "high"))
        low, high = low / scales, high / scales

        def misfit(values: FloatArray) -> FloatArray:
            try:
                torque = self._torque_with(cause, values * scales)
            except EffectError:  # a step to what no robot can have, a negative mass for one
                return np.full(target.size, _IMPOSSIBLE)
            return self.in_noise(torque - target).ravel()

        inside = np.clip(cause_values(cause) / scales, low + 1e-9, high - 1e-9)
        found = least_squares(misfit, inside, bounds=(low, high), max_nfev=12)
        return float(found.cost)

    def near_distance(self, pair: Pair) -> float:
        """Return what a motion is expected to say [nats]: cheap, both causes taken as linear.

        Where the values are fixed it is `distance`; it is the same where the effects are linear,
        and never needs an iteration. Where earlier logs leave values open, it is

            -4 ln E exp(-d / 4),  d = 1/2 |r + G z|^2,  z normal with mean 0 and covariance 1

        with r what the rival leaves at the values expected and G how this changes with the values
        of the true cause. exp(-d / 4) / 2 bounds the chance that noise names the wrong cause
        (Bhattacharyya), so that this is the distance with the same bound at values that are known.
        """
        left, moved = self._left(pair)  # moved has no columns where the values are fixed
        gram, lever = moved.T @ moved, moved.T @ left
        least = left @ left - lever @ np.linalg.solve(4.0 * np.eye(len(gram)) + gram, lever)
        grown = np.linalg.slogdet(np.eye(len(gram)) + 0.25 * gram)[1]
        return float(0.5 * least + 2.0 * grown)

    def _left(self, pair: Pair) -> tuple[FloatArray, FloatArray]:
        """Return r (N m,) and G (N m, p) of `near_distance`; p is 0 where the values are fixed.

        Where earlier logs know the values of the rival, there are more rows: what it costs to leave
        these.
        """
        true, other = pair
        apart = self.in_noise(self.expected_torques[true] - self.expected_torques[other])
        spread, held = self.rivals.open_part(true), self.sensitivities[other]
        own = held[:, :0] if spread is None else self.sensitivities[true] @ spread
        left, known = np.column_stack([apart.ravel(), own]), self.rivals.open_part(other)
        if known is not None:
            held = np.concatenate([held @ known, np.eye(len(known))])
            left = np.concatenate([left, np.zeros((len(known), left.shape[1]))])
        left -= held @ np.linalg.lstsq(held, left)[0]
        return left[:, 0], left[:, 1:]

    def misfit(self, pair: Pair) -> FloatArray:
        """Return what the refitted other cause leaves of a true one's torque, (N, m) over noise.

        The other one is taken as linear in its parameters. The odds are half the sum of squares.
        """
        target = self.expected_torques[pair[0]]
        return np.asarray(self._left(pair)[0][: target.size].reshape(target.shape))

    def distances(self, pair: Pair) -> FloatArray:
        """Return `distance` (k,) at values of the true cause that earlier logs leave open.

        Both causes are taken as linear, the rival is refitted to all logs. One number where the
        values are fixed.
        """
        left, moved = self._left(pair)
        if not moved.size:
            return np.array([self.distance(pair)])
        steps = np.random.default_rng(0).normal(size=(moved.shape[1], _DRAWS))
        return np.asarray(0.5 * np.sum((left[:, None] + moved @ steps) ** 2, axis=0))

    def signal(self, number: int) -> float:
        """Return half the squared torque that a cause adds, each row in units of its noise."""
        added = self.in_noise(self.expected_torques[number] - self.torque(()))
        return float(0.5 * np.sum(added**2))

    def information(self) -> float:
        """Return log det of the information on all parameters of all rivals, D-optimality's aim.

        Beside what is known before: each parameter to one typical size. So a parameter that no
        motion shows costs a constant.
        """
        columns = np.concatenate(self.sensitivities, axis=1)
        return float(np.linalg.slogdet(np.eye(columns.shape[1]) + columns.T @ columns)[1])

    def widths(self, number: int) -> FloatArray:
        """Return the half widths (p,) of the 90 % intervals of a cause, in units of its parameters.

        From the noise and, as in `information`, what is known before. What the motion does not
        show keeps the width that it had.
        """
        slopes = self.sensitivities[number]
        scales = cause_numbers(self.rivals.causes[number], "scale")
        spread = np.linalg.inv(np.eye(len(scales)) + slopes.T @ slopes)
        return np.asarray(_SIDES * scales * np.sqrt(np.diag(spread)))


def _trust(robot: Robot, motion: Motion, period: float) -> FloatArray:
    """Return weights (m, N): 0 where a joint that a gear moves turns round, 1 where it moves."""
    velocity = motion.velocity[:, robot.actuated]
    acceleration = np.asarray(motion.acceleration)[:, robot.actuated]
    lasting = REVERSAL * period * np.sqrt(np.mean(acceleration**2, axis=0))
    typical = 0.5 * np.sqrt(np.mean(velocity**2, axis=0))
    each = gate(velocity, np.minimum(lasting, typical))
    moves = np.abs(robot.transmission.topology.T) > 0.0
    return np.stack([each[:, own].min(axis=1) for own in moves])
