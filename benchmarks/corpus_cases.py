"""Generated cases with known truth, from a plant that shares no code with the library."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.recover.plant import JOINTS, Lane

# Effect name -> (flaw of the plant, smallest and largest size); drawn log-uniformly.
SINGLE = {
    "viscous_friction": ("viscous", 0.02, 0.8),
    "coulomb_friction": ("coulomb", 0.05, 1.5),
    "stribeck_friction": ("stribeck", 0.3, 1.0),
    "quadratic_drag": ("drag", 0.02, 0.3),
    "transmission_efficiency": ("eta_f", 0.97, 0.65),
    "rotor_inertia": ("extra_rotor", 0.008, 0.08),
    "payload_mass": ("foot_mass", 0.03, 0.8),
    "center_of_mass": ("shin_shift", 0.005, 0.05),
    "joint_spring": ("spring", 0.3, 6.0),
    "torque_ripple": ("ripple", 0.05, 0.8),
    "torque_constant": ("torque_factor", 1.03, 1.25),
    "torque_offset": ("torque_offset", 0.05, 0.8),
    "actuation_delay": ("delay", 0.002, 0.015),
    "position_offset": ("encoder_offset", 0.01, 0.1),
    "gravity_direction": ("tilt", 0.01, 0.1),
    "thermal_drift": ("fading", 0.004, 0.02),
    "current_limit": ("current_limit", 0.9, 0.65),
    "joint_compliance": ("stiffness", 1500.0, 150.0),
    "backlash": ("lash", 0.006, 0.05),
}
UNKNOWN = {
    "hysteresis": (0.15, 0.8),
    "position_friction": (0.2, 1.0),
    "dead_zone": (0.15, 0.8),
    "growing_friction": (0.03, 0.15),
    "cubic": (0.02, 0.08),
    "coupling": (0.1, 0.6),
}
WHOLE_ROBOT = {"payload_mass", "center_of_mass", "actuation_delay", "gravity_direction"}
TYPICAL_TORQUE = (12.0, 4.0)  # N m, largest in a usual run


@dataclass(frozen=True)
class Case:
    """What was hidden and how it was recorded.

    Attributes:
        truth: (effect, place) pairs; empty for none.
        unknown: name of a flaw outside the list, or "".
        values: (effect, place) -> size put in.
        lanes: the runs.
        duration: of each run [s].
    """

    truth: tuple[tuple[str, str], ...]
    unknown: str
    values: dict[tuple[str, str], float]
    lanes: tuple[Lane, ...]
    duration: float

    @property
    def label(self) -> str:
        hidden = "+".join(f"{e}@{w}" for e, w in self.truth)
        return self.unknown or hidden or "none"


def make_cases(count: int, seed: int) -> list[Case]:
    """Return `count` cases: 12 % without a flaw, 15 % outside the list, the rest 1 to 3 effects."""
    random = np.random.default_rng(seed)
    cases = []
    for number in range(count):
        kind = random.choice(
            ["none", "unknown", "one", "two", "three"], p=[0.12, 0.15, 0.5, 0.17, 0.06]
        )
        flaws: dict[str, float | tuple[float, float]] = {}
        truth: dict[tuple[str, str], float] = {}
        unknown = ""
        if kind == "unknown":
            unknown = str(random.choice(list(UNKNOWN)))
            low, high = UNKNOWN[unknown]
            size = float(np.exp(random.uniform(np.log(low), np.log(high))))
            both = unknown in ("coupling",)
            flaws[unknown] = size if both else _at(random.integers(3), size, 0.0)
        for name in _choice(random, kind):
            _hide(random, name, flaws, truth)
        cases.append(_recorded(random, flaws, truth, unknown, number))
    return cases


def _choice(random: np.random.Generator, kind: str) -> list[str]:
    size = {"one": 1, "two": 2, "three": 3}.get(kind, 0)
    names = [str(n) for n in random.choice(list(SINGLE), size=size, replace=False)]
    if size > 1:  # bouncing links and soft gears come alone
        names = [n for n in names if n not in ("backlash", "joint_compliance", "stribeck_friction")]
    return names


def _at(place: int, value: float, absent: float) -> tuple[float, float]:
    """Return (hip, knee) with `value` at hip (0), knee (1) or both (2)."""
    return (value if place != 1 else absent, value if place != 0 else absent)


def _hide(
    random: np.random.Generator,
    name: str,
    flaws: dict[str, float | tuple[float, float]],
    truth: dict[tuple[str, str], float],
) -> None:
    flaw, low, high = SINGLE[name]
    size = float(np.exp(np.log(low) + random.uniform() * (np.log(high) - np.log(low))))
    if name in WHOLE_ROBOT:
        flaws[flaw] = size
        places = {"payload_mass": ("foot",), "center_of_mass": ("shin",)}.get(name, ("robot",))
        if name == "actuation_delay":
            places = JOINTS
        truth.update({(name, place): size for place in places})
        return
    place = int(random.choice([0, 1, 2], p=[0.4, 0.4, 0.2]))
    chosen = [JOINTS[k] for k in (0, 1) if place in (k, 2)]
    truth.update({(name, joint): size for joint in chosen})
    if name == "transmission_efficiency":
        flaws["eta_f"] = _at(place, size, 1.0)
        flaws["eta_b"] = _at(place, 2.0 - 1.0 / size, 1.0)
    elif name == "current_limit":
        limits = tuple(size * t for t in TYPICAL_TORQUE)
        flaws[flaw] = (limits[0] if place != 1 else np.inf, limits[1] if place != 0 else np.inf)
    elif name == "backlash":
        flaws["lash"] = _at(place, size, 0.0)
        flaws["stiffness"] = _at(place, 3000.0, np.inf)
    elif name == "stribeck_friction":
        flaws["stribeck"] = _at(place, size, 0.0)
        flaws["stribeck_speed"] = float(random.uniform(0.15, 0.5))
    elif name == "joint_spring":
        flaws["spring"] = _at(place, size, 0.0)
        flaws["rest"] = float(random.uniform(-0.5, 0.5))
    elif name == "torque_ripple":
        flaws["ripple"] = _at(place, size, 0.0)
        flaws["ripple_order"] = float(random.choice([6.0, 10.0, 20.0, 40.0, 60.0]))
        flaws["ripple_phase"] = float(random.uniform(0.0, 6.0))
    else:
        absent = {"torque_factor": 1.0, "stiffness": np.inf}.get(flaw, 0.0)
        flaws[flaw] = _at(place, size, absent)


def _recorded(
    random: np.random.Generator,
    flaws: dict[str, float | tuple[float, float]],
    truth: dict[tuple[str, str], float],
    unknown: str,
    number: int,
) -> Case:
    setting = random.choice(["practice", "two", "single"], p=[0.5, 0.2, 0.3])
    noise = float(random.choice([1.0, 1.0, 3.0]))
    amplitude = float(random.uniform(0.7, 1.3))
    start = int(random.integers(10_000))
    runs = {"practice": [0, 0, 1, 2], "two": [0, 1], "single": [0]}[str(setting)]
    duration = 10.0 if setting == "practice" else float(random.choice([5.0, 10.0]))
    lanes = tuple(
        Lane(dict(flaws), start + run, amplitude, 100 * number + k, noise)
        for k, run in enumerate(runs)
    )
    return Case(tuple(truth), unknown, truth, lanes, duration)
