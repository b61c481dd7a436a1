"""Rival causes: what each predicts for a motion, and how far apart they stay after refitting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from scipy.optimize import least_squares

from wbc.arrays import FloatArray
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import effect_class
from wbc.errors import DesignError
from wbc.robot import Effect, Motion, Robot

_STEP = 1e-4  # of a parameter's typical size, as its own documentation says


def parse_rival(text: str, robot: Robot) -> Effect:
    """Return the effect of `EFFECT@PLACE` or `EFFECT@PLACE:PARAMETER=VALUE,...`.

    Parameters that are left out lie one typical size away from where the effect is not there.

    Raises:
        DesignError: text of another form, or an effect that acts through a memory or a soft gear.
        EffectError: an unknown effect, place or parameter.
    """
    head, _, tail = text.partition(":")
    name, at, where = head.strip().partition("@")
    if not at or not where:
        raise DesignError(f"--between '{text}': use EFFECT@PLACE or EFFECT@PLACE:PARAMETER=VALUE.")
    kind = effect_class(name)
    values = dict(kind.null_values(robot, where))
    for parameter in kind.parameters:
        now = values[parameter.name]
        up = now + parameter.scale
        values[parameter.name] = up if up <= parameter.high else now - parameter.scale
    for item in filter(None, tail.split(",")):
        key, _, value = item.partition("=")
        try:
            values[key.strip()] = float(value)
        except ValueError as cause:
            raise DesignError(f"--between '{text}': '{item}' is not PARAMETER=VALUE.") from cause
    effect = kind.at(where, values)
    effect.check_place(robot)
    gears = effect.change(robot).transmission
    soft = bool(np.isfinite(gears.stiffness).any() or np.any(gears.backlash > 0.0))
    if soft or effect.first_memory(robot) is not None or kind.measured is not Effect.measured:
        raise DesignError(
            f"'{name}' acts through a memory, a soft gear or the encoders; only effects whose "
            "torque follows from the present motion can be told apart by a planned motion."
        )
    return effect


@dataclass(frozen=True, eq=False)
class Rivals:
    """Effects of which one is the cause, on a robot with a gear on every coordinate.

    Attributes:
        robot: without any of them.
        effects: two or more, with the values at which they are expected.
        noise: (m,) standard deviation of the measured rotor torque [N m], white from row to row.
    """

    robot: Robot
    effects: tuple[Effect, ...]
    noise: FloatArray

    def __post_init__(self) -> None:
        """Check what can be compared."""
        if len(self.effects) < 2:
            raise DesignError("an experiment decides between two causes or more; give --between.")
        if len({effect.key for effect in self.effects}) < len(self.effects):
            raise DesignError(
                "a cause is given twice; an experiment decides between different ones."
            )
        if self.robot.floating_size:
            raise DesignError(
                f"'{self.robot.name}' has {self.robot.floating_size} coordinates without a gear; "
                "a planned motion needs a fixed base (lock the base's joints in robot.toml)."
            )
        if not np.all((self.noise > 0.0) & np.isfinite(self.noise)):
            raise DesignError("the noise of the torque must be > 0 and finite; give --noise.")

    def predictions(self, motion: Motion) -> Predictions:
        """Return what the rivals predict along one motion."""
        return Predictions(self, motion, link_torque(self.robot, motion))


class Predictions:
    """Torques of rivals along one motion; the links' torque is computed once where it is shared."""

    def __init__(self, rivals: Rivals, motion: Motion, links: FloatArray) -> None:
        """Keep the motion and `link_torque` of the robot without any rival along it."""
        self.rivals, self.motion, self._links = rivals, motion, links

    def torque(self, effect: Effect | None) -> FloatArray:
        """Return the rotor torque (N, m) [N m] with one effect, or with none."""
        base = self.rivals.robot
        robot = base if effect is None else base.with_effect(effect)
        links = self._links if robot.model is base.model else link_torque(robot, self.motion)
        return rotor_torque(robot, self.motion, links)[0]

    def peak(self) -> FloatArray:
        """Return the largest torque (N, m) [N m] that any of the rivals asks for."""
        every = [self.torque(effect) for effect in (None, *self.rivals.effects)]
        return np.asarray(np.max(np.abs(every), axis=0))

    def sensitivity(self, effect: Effect) -> FloatArray:
        """Return d torque / d parameter over noise, per typical size, (N m, p)."""
        columns = []
        for parameter in effect.parameters:
            value = getattr(effect, parameter.name)
            step = _STEP * parameter.scale
            step = step if value + step <= parameter.high else -step
            moved = effect.with_values({parameter.name: value + step})
            slope = (self.torque(moved) - self.torque(effect)) / step * parameter.scale
            columns.append((slope / self.rivals.noise).ravel())
        return np.stack(columns, axis=1)

    def distance(self, true: Effect, other: Effect) -> float:
        """Return the expected log-odds of `true` over `other`, refitted: half the squared misfit.

        In natural logarithms; each residual counts in units of its noise.
        """
        target = self.torque(true)
        scales = np.array([parameter.scale for parameter in other.parameters])
        bounds = [
            np.array([getattr(p, end) for p in other.parameters]) / scales
            for end in ("low", "high")
        ]
        names = [parameter.name for parameter in other.parameters]

        def misfit(values: FloatArray) -> FloatArray:
            moved = other.with_values(dict(zip(names, (values * scales).tolist(), strict=True)))
            return np.asarray(((self.torque(moved) - target) / self.rivals.noise).ravel())

        start = np.array([getattr(other, name) for name in names]) / scales
        inside = np.clip(start, bounds[0] + 1e-9, bounds[1] - 1e-9)
        found = least_squares(misfit, inside, bounds=tuple(bounds), max_nfev=12)
        return float(found.cost)

    def odds(self) -> dict[tuple[int, int], float]:
        """Return the expected log-odds of every rival, if true, over every other one."""
        pairs = permutations(range(len(self.rivals.effects)), 2)
        effects: Sequence[Effect] = self.rivals.effects
        return {(i, j): self.distance(effects[i], effects[j]) for i, j in pairs}

    def information(self) -> float:
        """Return log det of the information on all parameters of all rivals, D-optimality's aim."""
        parts = [self.sensitivity(effect) for effect in self.rivals.effects]
        columns = np.concatenate(parts, axis=1)
        sign, value = np.linalg.slogdet(columns.T @ columns)
        return float(value) if sign > 0.0 else -np.inf
