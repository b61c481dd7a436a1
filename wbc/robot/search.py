"""What an effect offers a search for causes in logs, apart from its physics."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc.arrays import BoolArray, FloatArray

if TYPE_CHECKING:
    from wbc.robot.effect import Effect, Motion
    from wbc.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class Evidence:
    """What is known about a set of logs when an effect proposes where to start.

    Attributes:
        motions: one per log, (N, ...) arrays.
        unexplained: one (N, nv) per log: measured minus modelled torque at the coordinates
            [N m, N], driven rows at the motor output.
        reported: one (N, m) per log: torque on the rotors that the drives report [N m].
        currents: (m,) whether all that is known of a drive's torque is the current in its motor;
            None where no drive reports one.
    """

    motions: tuple[Motion, ...]
    unexplained: tuple[FloatArray, ...]
    reported: tuple[FloatArray, ...]
    currents: BoolArray | None = None


@dataclass(frozen=True, eq=False)
class Screen:
    """One linear way in which an effect may explain a residual.

    The regression takes the change that each unit makes to the model's torque as a column, and
    hands the coefficients back: the parameters are `combine(coefficients)`.

    Attributes:
        units: parameter values of the r unit effects.
        combine: (r,) coefficients -> parameter values, possibly outside their bounds.
        expected: coefficient of every unit where the logs do not tell it.
    """

    units: tuple[Mapping[str, float], ...]
    combine: Callable[[FloatArray], dict[str, float]]
    expected: float = 0.0

    @classmethod
    def fixed(cls, values: Mapping[str, float]) -> Screen:
        """Return the screen of an effect that is not linear in any parameter.

        Its size is part of its shape: a coefficient far from one says that the shape is wrong.
        """
        chosen = dict(values)

        def combine(coefficients: FloatArray) -> dict[str, float]:
            fits = 0.4 < float(coefficients[0]) < 2.5
            return chosen if fits else dict.fromkeys(chosen, np.nan)

        return cls((chosen,), combine, expected=1.0)

    @classmethod
    def shapes(
        cls, linear: str, shape: str, tried: Iterable[float], step: float = 1.0
    ) -> tuple[Screen, ...]:
        """Return the screens of an effect with two parameters, one per value of its shape.

        Args:
            linear: name of the parameter in which it is linear.
            shape: name of the other one.
            tried: its values.
            step: the unit of the linear one.
        """

        def screen(value: float) -> Screen:
            unit = {linear: step, shape: value}
            return cls((unit,), lambda c: {linear: step * float(c[0]), shape: value})

        return tuple(screen(float(value)) for value in tried)


@dataclass(frozen=True)
class Quantity:
    """A number of a machine that a person can check.

    Attributes:
        value: in `unit`.
        unit: SI unit.
        instead: beginning of the names of what is said in its place where logs do not tell it.
    """

    value: float
    unit: str
    instead: str = ""


def small_steps(
    kind: type[Effect], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return the screen of a small step of every parameter that is no shape, none without any.

    Args:
        kind: class of the effect.
        robot: on which it may sit.
        where: its place there.
        evidence: what the logs say.
    """
    null = kind.null_values(robot, where)
    steps: dict[str, float] = {}
    for parameter in kind.at(where, null).parameters:
        if not parameter.shape:
            step = 1e-3 * parameter.scale
            inside = null[parameter.name] + step <= parameter.high
            steps[parameter.name] = step if inside else -step

    def combine(coefficients: FloatArray) -> dict[str, float]:
        changes = zip(steps.items(), coefficients, strict=True)
        return {**null, **{name: null[name] + float(c) * step for (name, step), c in changes}}

    units = tuple({**null, name: null[name] + step} for name, step in steps.items())
    return (Screen(units, combine),) if units else ()


def usual_cost(effect: Effect) -> float:
    """Return what the numbers of an effect cost that no machine is likely to have [nats].

    The sum over the parameters of what is `usual`.
    """
    values = effect.values
    return sum(p.usual.cost(values[p.name]) for p in effect.parameters if p.usual is not None)


_NONE = np.zeros(0)
_NONE.flags.writeable = False


@dataclass(frozen=True, eq=False)
class SearchOffer:
    """What a search for causes asks of a kind of effect; the defaults do for most kinds.

    An effect's file gives its own as the class attribute `search`. Every function takes the effect
    first, `screens` its class.

    Attributes:
        expected: log prior odds [nats], beside other effects, that a real machine has it where its
            model has not: robots come with models without friction, and friction is in all.
        claims: how many things it says of a machine at once; each costs as much as a name of its
            own before the logs speak, so that an effect that says less is named where it suffices.
        near_rest: whether the effect is gone where the joint moves at its usual speed.
        inseparable: name of another effect -> from where on no run of a robot tells the two apart,
            and what does instead, in words.
        screens: (kind, robot, where, evidence) -> the linear ways in which it may explain a
            residual. By default one: a small step of every parameter that is no shape parameter,
            away from where the effect is not there. With a nonlinear shape parameter one per shape
            worth trying; `evidence` tells which those are.
        recognisable: (effect, robot, motions) -> whether these motions could show the effect for
            what it is, with these parameters. A wave of which less than one period was passed is
            any bend: a diagnosis must not name it.
        implausibility: (effect, robot with it, motions of the logs) -> what its numbers cost that
            no machine is likely to have [nats]; by default `usual_cost`.
        departures: (effect) -> (k,) how far its numbers lie from what is usual, in standard
            deviations (default: none). A fit counts half their squares beside what the logs say
            [nats]: what logs do not tell stays usual. Zero where the effect is not there.
        freedom: (effect) -> how many numbers had to be chosen to describe it; fewer are believed
            more easily.
        quantities: (effect, robot without it) -> the numbers that a person can check, where the
            parameters are not them.
        remarks: (effect, robot without it) -> sentences on what these numbers mean on the robot.
    """

    expected: float = 0.0
    claims: int = 1
    near_rest: bool = False
    inseparable: Mapping[str, str] = field(default_factory=dict)
    screens: Callable[[Any, Robot, str, Evidence], tuple[Screen, ...]] = small_steps
    recognisable: Callable[[Any, Robot, Sequence[Motion]], bool] = lambda effect, robot, seen: True
    implausibility: Callable[[Any, Robot, Sequence[Motion]], float] = lambda effect, robot, seen: (
        usual_cost(effect)
    )
    departures: Callable[[Any], FloatArray] = lambda effect: _NONE
    freedom: Callable[[Any], int] = lambda effect: len(effect.parameters)
    quantities: Callable[[Any, Robot], Mapping[str, Quantity]] = lambda effect, robot: {}
    remarks: Callable[[Any, Robot], tuple[str, ...]] = lambda effect, robot: ()
