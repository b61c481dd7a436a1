"""Draw the cases of the corpus: a case follows from the seed and its number alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.corpus.case import Case
from benchmarks.corpus.excitation import Excitation
from benchmarks.corpus.families import CLOSED_LOOP, FAMILIES, draw_machine
from benchmarks.corpus.flaws import AT_MOTORS, DRAWING, INERTIAL, POINTS, WHOLE_ROBOT, Flaw
from benchmarks.corpus.machine import Machine
from benchmarks.corpus.recipes import Typical, flaws_of_size, recipe
from benchmarks.corpus.sensors import Sensors
from benchmarks.corpus.signature import Signatures
from benchmarks.corpus.stepping import STEP
from benchmarks.corpus.unlisted import DRAWN, NAMES, TWO_JOINTS

SEED = 20
COUNT = 520
LISTED = (
    "viscous_friction", "coulomb_friction", "stribeck_friction", "load_friction",
    "quadratic_drag", "transmission_efficiency", "rotor_inertia", "payload_mass",
    "center_of_mass", "joint_spring", "joint_compliance", "backlash", "torque_constant",
    "torque_offset", "torque_ripple", "actuation_delay", "position_offset",
    "gravity_direction", "supply_sag", "current_limit", "thermal_drift",
)  # fmt: skip
LATER = (
    "presliding", "directional_viscous_friction", "load_presliding", "load_stribeck_friction",
    "thermal_viscous_friction", "voltage_scaling", *AT_MOTORS,
)  # fmt: skip
"""Effects that came to the list later; seeds below `_FIRST` are the cases that they always were."""
_FIRST = {
    "presliding": 24, "directional_viscous_friction": 30, "load_presliding": 30, DRAWING: 30,
    "load_stribeck_friction": 33, "thermal_viscous_friction": 38, "voltage_scaling": 38,
    **dict.fromkeys(AT_MOTORS, 46),
}  # fmt: skip
_WRONG_DRAWINGS = 1.0 / 3.0  # share of all cases
_ONLY_CLOSED_LOOP = ("backlash", "current_limit")
BY_CONDITIONS = ("thermal_viscous_friction", "voltage_scaling")
_CONDITIONS = 0.3  # share of the cases from then on that record temperatures and voltage anyway
ONLY_PRESCRIBED = ("load_presliding", "load_stribeck_friction", *BY_CONDITIONS)
_AT_MOTORS = 0.5  # share of the machines with coupled motors whose first effect is at such a motor
_ALONE = ("backlash", "joint_compliance", "current_limit")
_ALL_GEARS = {"actuation_delay": 0.7} | dict.fromkeys(
    ("viscous_friction", "coulomb_friction", "transmission_efficiency", "load_friction",
     "torque_constant", "thermal_drift", *BY_CONDITIONS), 0.25
)  # fmt: skip
_SIZES, _SIZES_OUTSIDE = (0.7, 80.0), (8.0, 300.0)  # drawn, in floors
_TRIES = 6


def family_of(number: int, seed: int = SEED) -> str:
    """Return the family of case `number`, which is drawn first."""
    return _family(np.random.default_rng([seed, number]))


def _family(random: np.random.Generator) -> str:
    names, shares = zip(*FAMILIES, strict=True)
    return str(random.choice(names, p=shares))


def draw_case(number: int, seed: int = SEED) -> Case:
    """Return case `number` of the corpus with this seed."""
    random = np.random.default_rng([seed, number])
    machine = draw_machine(random, _family(random))
    sensors = _sensors(random)
    richness = str(random.choice(["poor", "fair", "good", "rich"], p=[0.2, 0.3, 0.25, 0.25]))
    excitations = _excitations(random, machine, richness, number)
    signatures = Signatures(machine, excitations, sensors)
    kind = str(random.choice(["none", "unlisted", "one", "two", "three"],
                             p=[0.1, 0.15, 0.5, 0.18, 0.07]))  # fmt: skip
    # Cases beyond the count hold a cause of the list beside one that is not in it.
    kind = "mixed" if number >= COUNT else kind
    flaws: list[Flaw] = []
    drawn = seed >= _FIRST[DRAWING] and bool(random.uniform() < _WRONG_DRAWINGS)
    if drawn:
        flaws += _wrong_drawing(random, machine)
    for effect in _effects(random, machine, kind, seed):
        # A mass beside a wrong drawing is part of what is wrong with the drawing.
        if drawn and effect in INERTIAL:
            continue
        flaws += _sized(random, effect, machine, signatures, kind)
    if machine.family in CLOSED_LOOP:
        flaws = [_in_whole_steps(flaw) for flaw in flaws]
    if any(flaw.effect in BY_CONDITIONS for flaw in flaws) or (
        seed >= _FIRST["voltage_scaling"]
        and machine.family not in CLOSED_LOOP
        and bool(np.random.default_rng([8, seed, number]).uniform() < _CONDITIONS)
    ):
        sensors = replace(sensors, conditions=True)
    return Case(
        number, machine, tuple(flaws), excitations, richness, sensors, signatures.torque_noise
    )


def _wrong_drawing(random: np.random.Generator, machine: Machine) -> list[Flaw]:
    """Return what the drawing of one link, or of all of them, lacks: density and two masses."""
    bodies = machine.bodies if random.uniform() < 0.5 else (str(random.choice(machine.bodies)),)
    worst = float(np.exp(random.uniform(np.log(0.05), np.log(0.3))))  # share of a link's mass
    flaws = []
    for name in bodies:
        link = machine.links[machine.body(name)]
        size = 2.0 * float(np.sqrt(np.trace(link.inertia) / link.mass))  # about the link's own
        values = {"scale": 1.0 + worst * float(random.uniform(-1.0, 1.0))}
        for k in range(POINTS):
            values[f"mass_{k}"] = worst * float(random.uniform(0.0, 0.5)) * link.mass
            point = link.com + size * random.uniform(-0.5, 0.5, 3)
            values |= {f"{axis}_{k}": float(x) for axis, x in zip("xyz", point, strict=True)}
        flaws.append(Flaw(DRAWING, name, values))
    return flaws


def _in_whole_steps(flaw: Flaw) -> Flaw:
    """Return a flaw as a stepped plant has it: torques are late by a whole number of steps."""
    if flaw.effect != "actuation_delay":
        return flaw
    return replace(flaw, values={"delay": STEP * round(flaw.values["delay"] / STEP)})


def _sensors(random: np.random.Generator) -> Sensors:
    velocity = float(random.choice([1e-3, 3e-3, 1e-2]))
    return Sensors(
        rate=float(random.choice([200.0, 250.0, 500.0, 1000.0], p=[0.15, 0.35, 0.4, 0.1])),
        position=float(random.choice([1e-5, 3e-5, 1e-4])),
        bits=int(random.choice([14, 16, 18])),
        velocity=velocity if random.uniform() > 0.2 else None,
        torque=float(random.choice([0.002, 0.005, 0.015])),
        force=float(random.choice([0.2, 0.5, 1.0])),
    )


def _excitations(
    random: np.random.Generator, machine: Machine, richness: str, number: int
) -> tuple[Excitation, ...]:
    pick: list[tuple[str, ...]] = {
        "poor": [("slow", "multisine", "one_joint")],
        "fair": [("multisine",), ("slow", "holds", "sweep")],
        "good": [("multisine",), ("repeat",), ("fast", "holds", "multisine")],
        "rich": [("multisine",), ("repeat",), ("fast", "shake"), ("holds", "sweep", "slow")],
    }[richness]
    # A diagnosis with a moving base costs several times as much per second of log.
    longest = 4.0 if machine.base_size else 6.0 if len(machine.driven) < 4 else 5.0
    shortest = 3.0 if machine.base_size else 4.0
    runs: list[Excitation] = []
    for k, choices in enumerate(pick):
        kind = str(random.choice(choices))
        duration = float(np.round(random.uniform(shortest, longest), 1))
        noise = 100 * number + k
        if kind == "repeat":
            lead = float(random.uniform(5e-4, 4e-3))
            runs.append(replace(runs[0], noise=noise, lead=lead))
        else:
            runs.append(Excitation(kind, 100 * number + k, duration, noise))
    return tuple(runs[:3] if machine.base_size else runs)


def _effects(random: np.random.Generator, machine: Machine, kind: str, seed: int) -> list[str]:
    since = [name for name in LATER if seed >= _FIRST[name] and name not in AT_MOTORS]
    inside = (*LISTED, *since)
    new = "presliding" in inside
    closed, single = machine.family in CLOSED_LOOP, len(machine.driven) == 1
    outside = [n for n in (NAMES if new else DRAWN) if not (single and n in TWO_JOINTS)]
    if kind == "unlisted":
        return [str(random.choice(outside))]
    if kind == "mixed":
        prescribed = ONLY_PRESCRIBED if closed else ()
        listed = [n for n in inside if n not in (*_ALONE, *prescribed)]
        return [str(random.choice(listed)), str(random.choice(outside))]
    elsewhere = ONLY_PRESCRIBED if closed else _ONLY_CLOSED_LOOP
    possible = [n for n in inside if n not in elsewhere]
    if kind in ("two", "three"):
        possible = [n for n in possible if n not in _ALONE]
    size = {"one": 1, "two": 2, "three": 3}.get(kind, 0)
    names = [str(name) for name in random.choice(possible, size=size, replace=False)]
    later = names and machine.coupled and seed >= _FIRST[AT_MOTORS[0]]
    if later and random.uniform() < _AT_MOTORS:
        names[0] = str(random.choice(AT_MOTORS))
    return names


def _places(random: np.random.Generator, effect: str, machine: Machine) -> tuple[str, ...]:
    if effect in WHOLE_ROBOT:
        return ("robot",)
    if effect == "payload_mass":
        return (str(random.choice([*machine.bodies, *(name for name, _, _ in machine.contacts)])),)
    if effect == "center_of_mass":
        return (str(random.choice(machine.bodies)),)
    if effect in AT_MOTORS:
        return (str(random.choice(machine.coupled)),)
    if random.uniform() < _ALL_GEARS.get(effect, 0.0):
        return machine.driven
    first = 1 if effect in TWO_JOINTS else 0
    return (str(random.choice(machine.driven[first:])),)


def _sized(
    random: np.random.Generator,
    effect: str,
    machine: Machine,
    signatures: Signatures,
    kind: str,
) -> Sequence[Flaw]:
    """Return the effect in a size drawn in floors; places that do not feel it are drawn again."""
    typical = Typical.of(machine, signatures)
    range_ = _SIZES_OUTSIDE if kind == "unlisted" else _SIZES
    target = float(np.exp(random.uniform(*np.log(range_))))
    flaws: Sequence[Flaw] = ()
    for _ in range(_TRIES):
        places = _places(random, effect, machine)
        shape = int(random.integers(2**31))  # the same story in all gears
        recipes = [recipe(np.random.default_rng(shape), effect, place, typical) for place in places]
        most = min(r.most for r in recipes)
        if effect in ("backlash", "current_limit"):  # not in proportion
            return flaws_of_size(effect, places, recipes, float(random.uniform(0.2, 1.0)) * most)
        u = 0.3 * most
        for _ in range(2):
            felt = largest(signatures.of(flaws_of_size(effect, places, recipes, u)))
            u = min(u * target / max(felt, 1e-9), most)
        flaws = flaws_of_size(effect, places, recipes, u)
        if largest(signatures.of(flaws)) > min(0.5 * target, 2.0):
            break
    return flaws


def largest(signature: np.ndarray) -> float:
    """Return the rms of a signature at the output that feels it most, in floors."""
    return float(np.sqrt(np.max(np.mean(signature**2, axis=0))))
