"""Many designs at once against the metrics of one robot, up to rounding."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.metrics.one_design import robot_at
from tests.sim.random_robots import geared
from wbc import Robot, load_robot, metrics
from wbc.errors import DynamicsError, TransmissionError

LEG, ARM = load_robot("planar_leg"), load_robot("planar_leg_fixed")
ROUNDING = {"rtol": 1e-9, "atol": 1e-12}


def varied(robot: Robot, k: int, seed: int = 1) -> metrics.Designs:
    """Return designs in which everything varies, some of the gears self-locking."""
    rng, m = np.random.default_rng(seed), robot.transmission.size
    q = np.tile(robot.pose(), (k, 1))
    q[:, robot.actuated_position] += 0.2 * rng.normal(size=(k, m))
    gears = {
        "gear_ratio": rng.uniform(6, 160, k) * rng.choice([-1, 1], k),
        "rotor_inertia": rng.uniform(1e-6, 1e-4, (k, m)),
        "forward_efficiency": rng.uniform(0.4, 0.98, (k, m)),
        "backward_efficiency": rng.uniform(-0.1, 0.98, (k, m)),
        "rotor_coulomb_friction": rng.uniform(0.0, 0.1, (k, m)),
        "torque_limit": rng.uniform(0.5, 3.0, (k, m)),
    }
    return metrics.Designs.of(robot, q, gears)


@pytest.mark.parametrize("name", ["planar_leg", "planar_leg_fixed", "parallelogram_leg", "solo12"])
@pytest.mark.parametrize("coupled", [False, True])
def test_many_designs_are_the_metrics_of_each(name: str, coupled: bool) -> None:
    robot = replace(load_robot(name), rotors_turn_with_links=coupled)
    contact, axes = ("HR_foot", "xyz") if name == "solo12" else ("foot", "xz")
    designs = varied(robot, 40)
    n = np.arange(1.0, 1.0 + len(axes))
    found = metrics.design_metrics(designs, contact, n, axes, load=30.0)
    for i in range(designs.size):
        one, q = robot_at(designs, i)
        task = metrics.contact_task(one, q, contact, axes)
        unit = task.direction(n)
        free, driven = (unit @ task.mobility(mode)[0] @ unit for mode in (0.0, -1.0))
        held_still = driven <= 1e-12 * free
        reach = metrics.force_capability(one, q, contact, axes)
        force = reach.along(n)
        held = metrics.holding(one, q, contact, n, 30.0, axes)
        factor = metrics.impact_mitigation(one, q, contact, axes)
        expected = {
            "inertia": 1.0 / free,
            "backward_inertia": np.inf if held_still else 1.0 / driven,
            "conventional": force.conventional,
            "lift": force.lift,
            "hold": force.hold,
            "impact_mitigation": np.nan if held_still else factor.along(n),
            "impact_mitigation_lossless": (
                metrics.impact_mitigation(one, q, contact, axes, 0.0).along(n)
            ),
            "backdriving_force": force.backdriving_force,
            "holding_torque": np.linalg.norm(held.least),
            "holding_torque_lossless": np.linalg.norm(held.lossless),
            "heat_saved": held.heat_saved,
        }
        if not held_still and not one.transmission.self_locking.any():
            expected["impact_mitigation_determinant"] = factor.determinant
        if not robot.floating_size:
            tensor = metrics.forward_generalized_inertia(one, q, contact, axes)
            expected["forward_inertia"] = 1.0 / (unit @ np.linalg.inv(tensor) @ unit)
        for metric, value in expected.items():
            told = getattr(found, metric)[i]
            np.testing.assert_allclose(told, np.squeeze(value), err_msg=metric, **ROUNDING)
    assert designs.gears["backward_efficiency"].min() < 0.0


def test_self_locking_gears_on_a_fixed_base_are_infinitely_heavy() -> None:
    def table(robot: Robot, gears: dict | None) -> metrics.DesignMetrics:
        designs = metrics.Designs.of(robot, robot.pose("paper"), gears)
        return metrics.design_metrics(designs, "foot", [0, 1], "xz")

    locked = table(ARM, {"forward_efficiency": [0.45, 0.6]})
    assert locked.backward_inertia[0] == locked.hold[0] == np.inf
    assert np.isnan(locked.impact_mitigation[0])
    assert np.isfinite(locked.inertia).all()
    assert locked.backward_inertia[1] > locked.inertia[1]
    # On a floating base the leg is a rigid body then, which mitigates nothing.
    rigid = table(LEG, {"forward_efficiency": [0.45]})
    assert np.isfinite(rigid.backward_inertia[0])
    assert rigid.impact_mitigation[0] == pytest.approx(0.0, abs=1e-9)
    # One locked gear leaves the other one to give.
    partly = table(geared(ARM, backward_efficiency=[-0.2, 0.5]), None)
    assert locked.inertia[0] < partly.backward_inertia[0] < np.inf


POSE, UP = LEG.configuration(hip=-0.5, knee=1.1), [0.0, 1.0]


def inertia(axes: str) -> np.ndarray:
    return metrics.generalized_inertia(LEG, POSE, "foot", axes)


def capability(q: np.ndarray) -> metrics.ForceCapability:
    return metrics.force_capability(LEG, q, "foot", "xz")


def locked_capability() -> metrics.ForceCapability:
    locking = geared(LEG, backward_efficiency=[-0.1, 0.0])
    reach = metrics.force_capability(locking, POSE, "foot", "xz")
    assert reach.along(UP).hold == np.inf
    return reach


DESIGNS = (
    ({"gears": {"ratio": [6.0]}}, "gear_ratio"),
    ({"gears": {"gear_ratio": [6.0, 0.0]}}, "design 1"),
    ({"gears": {"forward_efficiency": [0.9], "backward_efficiency": [1.2]}}, "create power"),
    ({"gears": {"gear_ratio": [6.0, 7.0], "torque_limit": [1.0, 2.0, 3.0]}}, "2, 3 designs"),
    ({"gears": {"gear_ratio": [[1.0, 2.0, 3.0]]}}, "shape"),
)
MISTAKES: list[tuple[str, Callable[[], object]]] = [
    *[(said, lambda x=given: metrics.Designs.of(LEG, POSE, **x)) for given, said in DESIGNS],
    ("hip, knee", lambda: locked_capability().vertices(-1)),
    ("loads no motor", lambda: capability(LEG.neutral()).along(UP)),
    ("loads no motor", lambda: capability(LEG.neutral()).vertices(0)),
    ("load", lambda: metrics.holding(LEG, POSE, "foot", UP, -1.0, "xz")),
    ("singular pose", lambda: metrics.impact_mitigation(ARM, np.zeros(2), "foot", "xz").matrix),
    ("cannot be", lambda: metrics.impact_mitigation(LEG, POSE, "foot").along([0.0, 1.0, 0.0])),
    (r"cannot be moved along \[-?0, -?1, -?0\]", lambda: inertia("xyz")),
    *[(f"'{axes}': name some of x, y", lambda x=axes: inertia(x)) for axes in ("xx", "", "xw")],
    ("singular pose", lambda: metrics.generalized_inertia(ARM, np.zeros(2), "foot", "xz")),
    ("3 of 5 undriven", lambda: metrics.forward_generalized_inertia(LEG, POSE, "foot", "xz")),
]


@pytest.mark.parametrize(("message", "ask"), MISTAKES)
def test_what_cannot_be_is_named(message: str, ask: Callable[[], object]) -> None:
    with pytest.raises((DynamicsError, TransmissionError), match=message):
        ask()
