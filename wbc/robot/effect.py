"""What a physical effect is to a robot: the hooks that controller, simulator and logs share.

What a search for causes in logs asks of an effect stands apart from its physics, in `SearchOffer`.
"""

from __future__ import annotations

import re
from abc import ABC
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import Field, dataclass, field, replace
from functools import cached_property
from math import isfinite
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, get_args

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.errors import EffectError, require_known

if TYPE_CHECKING:
    from wbc.robot.robot import Robot


@dataclass(frozen=True)
class Usual:
    """How the numbers of machines spread: a density that is flat and falls off at both ends.

    Attributes:
        low, high: range that machines usually have.
        spread: standard deviation of what lies outside it, of the logarithm if `factor`.
        factor: whether numbers are compared by their ratio.
    """

    low: float
    high: float
    spread: float
    factor: bool = False

    def departure(self, value: float) -> float:
        """Return how many standard deviations a number lies outside the range."""
        nearest = min(max(value, self.low), self.high)
        off = float(np.log(value / nearest)) if self.factor else value - nearest
        return off / self.spread

    def slope(self, value: float) -> float:
        """Return the derivative of the departure."""
        inside = self.low <= value <= self.high and self.low < self.high
        return 0.0 if inside else 1.0 / (self.spread * (value if self.factor else 1.0))

    def cost(self, value: float) -> float:
        """Return by how much less likely a number is than one in the range [nats]."""
        return 0.5 * self.departure(value) ** 2


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    Attributes:
        name: attribute of the effect that holds it.
        unit: SI unit, "1" for a pure number.
        null: value at which the effect is not there.
        low, high: bounds that physics allows and a fit searches.
        scale: a typical size, also the step of finite differences times 1e-4.
        shape: True if it only shapes the effect (a frequency, a rest angle) and has no null.
        doubt: share of the number that its model is off by, however long the logs are.
        usual: what machines have of it, None where any size is as likely.
    """

    name: str
    unit: str
    null: float
    low: float
    high: float
    scale: float
    shape: bool = False
    doubt: float = 0.0
    usual: Usual | None = None


def number(
    unit: str, null: float, low: float, high: float, scale: float, **more: Any
) -> Mapping[str, Any]:
    """Return what makes a field of an effect one of its parameters: `field(metadata=number(...))`.

    Arguments as of `Parameter`, whose name is the field's.
    """
    return {"parameter": Parameter("", unit, null, low, high, scale, **more)}


@dataclass(frozen=True, eq=False, slots=True)
class Memory:
    """An effect's own state in one step of a simulator.

    Attributes:
        value: the state at the start of the step, laid out by the effect.
        step: length of the step [s]; the motion's sample is its middle.
    """

    value: FloatArray
    step: float


@dataclass(frozen=True, eq=False)
class Motion:
    """Positions, velocities and what else was known at the same instants.

    Leading axes are free: one sample is (nq,) and (nv,), a whole log is (N, nq) and (N, nv).

    Attributes:
        position: q (..., nq), pinocchio's configuration vector [m, rad, quaternion].
        velocity: v (..., nv) [m/s, rad/s].
        acceleration: a (..., nv), or None where it is not known yet (a simulator's step).
        time: (...) [s], or None.
        temperature: (..., m) of the motors [deg C], or None.
        supply_voltage: (..., m) [V] at the motor drives, or None.
        feedback_torque: (..., m) on the rotors [N m]: what position drives command because of the
            motion they measure, not of their target; None where no drive follows a target.
        mesh_torque: T (..., m) [N m] that the gears give, where a simulator solves for it.
        memory: own state of the effect that is asked, where a simulator carries it; else None.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray | None = None
    time: FloatArray | None = None
    temperature: FloatArray | None = None
    supply_voltage: FloatArray | None = None
    feedback_torque: FloatArray | None = None
    mesh_torque: FloatArray | None = None
    memory: Memory | None = None

    def replace(self, **changes: Any) -> Motion:
        """Return a copy with some fields changed."""
        return replace(self, **changes)


Hook = Literal[
    "change",
    "joint_torque",
    "joint_friction",
    "rotor_torque",
    "drive",
    "drive_inverse",
    "meshed",
    "measured",
    "true",
]
"""The methods of an effect by which it acts on a robot."""


@dataclass(frozen=True, slots=True)
class MemoryEnergy:
    """Where the work went that an effect with a store of its own took over a step [J].

    Attributes:
        stored: change of the store.
        reloaded: part of it that no motion made: the load on what is bent changed.
        lost: turned to heat.
    """

    stored: float
    reloaded: float
    lost: float


def spoken(name: str) -> str:
    """Return the name of an effect or a parameter as words."""
    words = name.replace("_", " ")
    for person in ("coulomb", "stribeck"):
        words = words.replace(person, person.capitalize())
    return words


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
    """

    units: tuple[Mapping[str, float], ...]
    combine: Callable[[FloatArray], dict[str, float]]

    @classmethod
    def fixed(cls, values: Mapping[str, float]) -> Screen:
        """Return the screen of an effect that is not linear in any parameter.

        Its size is part of its shape: a coefficient far from one says that the shape is wrong.
        """
        chosen = dict(values)

        def combine(coefficients: FloatArray) -> dict[str, float]:
            fits = 0.4 < float(coefficients[0]) < 2.5
            return chosen if fits else dict.fromkeys(chosen, np.nan)

        return cls((chosen,), combine)

    @classmethod
    def shapes(
        cls, linear: str, shape: str, tried: Iterable[float], step: float = 1e-3
    ) -> tuple[Screen, ...]:
        """Return the screens of an effect with two parameters, one per value of its shape.

        Args:
            linear, shape: names of the parameter in which it is linear, and of the other one.
            tried: values of the latter.
            step: the unit of the former.
        """

        def screen(value: float) -> Screen:
            unit = {linear: step, shape: float(value)}
            return cls((unit,), lambda c: {**unit, linear: step * float(c[0])})

        return tuple(map(screen, tried))


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
    """Return the screen of a small step of every parameter that is no shape, none without any."""
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


def usual_cost(effect: Effect, *seen: object) -> float:
    """Return what the numbers of an effect cost that no machine is likely to have [nats].

    The sum over the parameters of what is `usual`, whatever the robot and its motions.
    """
    values = effect.values
    return sum(p.usual.cost(values[p.name]) for p in effect.parameters if p.usual is not None)


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
        gradual: whether derivatives tell what is left without it. They do not where a link then
            moves otherwise, or where its null lies beyond all that logs hold, as no limit does.
        inseparable: name of another effect -> from where on no run of a robot tells the two apart,
            and what does instead, in words.
        otherwise: the effect that it is where a robot has no place for it.
        screens: (kind, robot, where, evidence) -> the linear ways in which it may explain a
            residual: a small step of every parameter that is no shape (`small_steps`), or one way
            per shape worth trying.
        recognisable: (effect, robot, motions) -> whether these motions could show the effect for
            what it is: a wave of which less than one period was passed is any bend.
        implausibility: (effect, robot with it, motions of the logs) -> what its numbers cost that
            no machine is likely to have [nats].
        tolerated: (effect, robot without it, time between samples [s]) -> square of deviations at
            which what every machine is off by does the same; infinite where nothing does.
        drawn: whether its numbers are the ten log-Cholesky parameters of links, one link after the
            other. A fit holds them to the drawing, by how far drawings are usually wrong.
        freedom: (effect) -> how many numbers had to be chosen to describe it. A choice of one in n
            counts log n.
        quantities: (effect, robot without it) -> the numbers that a person can check, where the
            parameters are not them.
        remarks: (effect, robot without it) -> sentences on what these numbers mean on the robot.
    """

    expected: float = 0.0
    claims: int = 1
    near_rest: bool = False
    gradual: bool = True
    drawn: bool = False
    inseparable: Mapping[str, str] = field(default_factory=dict)
    otherwise: type[Effect] | None = None
    screens: Callable[[Any, Robot, str, Evidence], tuple[Screen, ...]] = small_steps
    recognisable: Callable[[Any, Robot, Sequence[Motion]], bool] = lambda effect, robot, seen: True
    implausibility: Callable[[Any, Robot, Sequence[Motion]], float] = usual_cost
    tolerated: Callable[[Any, Robot, float], float] = lambda effect, robot, step: np.inf
    freedom: Callable[[Any], float] = lambda effect: len(effect.parameters)
    quantities: Callable[[Any, Robot], Mapping[str, Quantity]] = lambda effect, robot: {}
    remarks: Callable[[Any, Robot], tuple[str, ...]] = lambda effect, robot: ()


@dataclass(frozen=True)
class Effect(ABC):
    """A physical effect at one place of the robot; subclasses are final, small and frozen.

    An effect either changes a number of the robot (`change`), or adds torque through one of the
    hooks below. Every hook takes arrays with free leading axes, so that the simulator calls it
    with one sample and identification with a whole log. A hook that is not overridden costs
    nothing: `None` means "no such torque".

    Attributes:
        where: name of the joint, body or contact it sits at; "robot" when it has no place.
        name: of the kind in logs, files and reports; that of the class unless it gives another one
            (`viscous_friction` of `ViscousFriction`).
        search: what a search for causes in logs asks of it.
        acts_by: the hooks that its class overrides: what it may act on. Nobody writes it down.
    """

    where: str

    name: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    explanation: ClassVar[str]
    experiment: ClassVar[str]
    search: ClassVar[SearchOffer] = SearchOffer()
    acts_by: ClassVar[frozenset[Hook]] = frozenset()

    def __init_subclass__(cls) -> None:
        """Note the class's name, which hooks it overrides, and which fields are parameters."""
        super().__init_subclass__()
        if "name" not in vars(cls):
            cls.name = re.sub("(?<!^)(?=[A-Z])", "_", cls.__name__).lower()
        given = [
            replace(value.metadata["parameter"], name=name)
            for name, value in vars(cls).items()
            if isinstance(value, Field) and "parameter" in value.metadata
        ]
        if given:
            cls.parameters = tuple(given)
        own = (h for h in get_args(Hook) if getattr(cls, h) is not getattr(Effect, h))
        cls.acts_by = frozenset(own)

    def __post_init__(self) -> None:
        """Check every parameter against its bounds."""
        for parameter, value in zip(self.parameters, self.values.values(), strict=True):
            if not (isfinite(value) and parameter.low <= value <= parameter.high):
                raise EffectError(
                    f"{self.name} at '{self.where}': {parameter.name} = {value:g} "
                    f"{parameter.unit} lies outside [{parameter.low:g}, {parameter.high:g}]."
                )

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Return the names at which this effect can sit on `robot` (default: the whole robot)."""
        return ("robot",)

    @classmethod
    def at(cls, where: str, values: Mapping[str, float] | None = None) -> Self:
        """Return the effect at `where` with `values`; what is left out is at its null value.

        Raises:
            EffectError: a parameter that the effect does not have, or a value out of bounds.
        """
        known = {parameter.name: parameter.null for parameter in cls.parameters}
        for name, value in (values or {}).items():
            require_known(EffectError, f"parameter of {cls.name}", name, known)
            known[name] = float(value)
        return cls(where=where, **known)

    @classmethod
    def null_values(cls, robot: Robot, where: str) -> dict[str, float]:
        """Return the values with which the effect changes nothing on `robot`.

        An effect that replaces a number of the robot has that number as its null value.
        """
        return {parameter.name: parameter.null for parameter in cls.parameters}

    def null_of(self, robot: Robot, parameter: Parameter) -> float:
        """Return the value of one of its parameters with which it changes nothing on `robot`."""
        return self.null_values(robot, self.where).get(parameter.name, parameter.null)

    @property
    def key(self) -> tuple[str, str]:
        """Name and place; a model holds each at most once."""
        return self.name, self.where

    @cached_property
    def values(self) -> Mapping[str, float]:
        """The parameters by name."""
        return {p.name: float(getattr(self, p.name)) for p in self.parameters}

    def said(self, units: Mapping[str, str] | None = None) -> str:
        """Return what it is and how large, as a person would say it: a noun with its place.

        Args:
            units: parameter -> unit where it is not that of a joint that turns.
        """
        name, listed = spoken(self.name), []
        for p in self.parameters:
            stated = (units or {}).get(p.name, p.unit)
            # A ratio may be 1.01: two digits would say that it is 1.
            unit, digits = ("", 3) if stated == "1" else (f" {stated}", 2)
            listed.append((spoken(p.name), f"{float(f'{self.values[p.name]:.{digits}g}'):g}{unit}"))
        if len(listed) == 1 and self.parameters[0].unit != "1":
            return f"{name} of {listed[0][1]} at {self.where}"
        few = listed if len(listed) <= 3 else []  # more are for a table
        numbers = ", ".join(f"{what} {size}" for what, size in few)
        return f"{name} at {self.where}" + (f" ({numbers})" if numbers else "")

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Return the same effect with some parameters changed.

        Raises:
            EffectError: a parameter that it does not have, or a value out of bounds.
        """
        for name in values:
            require_known(EffectError, f"parameter of {self.name}", name, self.values)
        if self.parameters is not type(self).parameters:  # its numbers say what it is made of
            return self.at(self.where, {**self.values, **values})
        changes: dict[str, Any] = dict(values)
        return replace(self, **changes)

    def check_place(self, robot: Robot) -> None:
        """Raise EffectError unless `where` is a place of this effect on `robot`."""
        places = self.places(robot)
        require_known(EffectError, f"place for {self.name}", self.where, places)

    def change(self, robot: Robot) -> Robot:
        """Return the robot with a number of its bodies or gears changed (default: unchanged)."""
        return robot

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray | None:
        """Return the smooth torque that the effect exerts on the coordinates, (..., nv) [N m]."""
        return None

    def joint_friction(self, robot: Robot, motion: Motion) -> FloatArray | None:
        """Return the level >= 0 of dry friction on the coordinates, (..., nv) [N m].

        The friction torque is -level sgn(v), anything between at v = 0; a level that depends on
        speed (Stribeck) uses |v|.
        """
        return None

    def rotor_torque(self, robot: Robot, motion: Motion) -> FloatArray | None:
        """Return the torque that the effect adds on the rotors, (..., m) [N m]."""
        return None

    def drive(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the rotor torque delivered for the reported or commanded `torque`, (..., m)."""
        return torque

    def drive_inverse(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque that the drive reports when it delivers `torque`, (..., m)."""
        return torque

    def meshed(
        self, robot: Robot, motion: Motion, output: FloatArray, mesh: FloatArray
    ) -> FloatArray:
        """Return the mesh input t (..., m) [N m] that gears need to give `output` T (..., m).

        An effect whose gear loses by more than its efficiencies at the present motion replaces
        its column of `mesh`, t by these efficiencies, along a log. In a simulator such a gear has
        no loss but this effect's `rotor_torque`, which finds T in `motion.mesh_torque`.
        """
        return mesh

    def memory_energy(self, robot: Robot, motion: Motion) -> MemoryEnergy | None:
        """Return where the work went that the effect took over a step; None without a store."""
        return None

    def first_memory(self, robot: Robot) -> FloatArray | None:
        """Return the effect's own state at the start of a simulation; None if it has none.

        A simulator carries what an action depends on beside the present motion from step to step,
        and shows it to every hook as `motion.memory`. Along a log that is None, and the hook works
        it out from the series.
        """
        return None

    def next_memory(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the effect's own state a step after `motion.memory`.

        The motion is that in the middle of the step, the torque (m,) [N m] what reaches `drive`.

        Raises:
            EffectError: the effect has a memory and does not say how it goes on.
        """
        raise EffectError(f"{self.name} has a memory (first_memory) but no next_memory; give both.")

    def measured(self, robot: Robot, motion: Motion) -> Motion:
        """Return what the encoders report for the true `motion`."""
        return motion

    def true(self, robot: Robot, motion: Motion) -> Motion:
        """Return the true motion behind what the encoders report; the inverse of `measured`."""
        return motion
