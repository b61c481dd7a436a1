"""The two-link leg of the paper, against numbers derived independently of this repository.

Pose: the paper's q1 = q2 = pi/3 is hip = -30 deg, knee = 60 deg here, the foot straight under the
hip. With z up and joints about +y the contact Jacobian is [[-.69282, -.34641], [0, .2]]; a 2R arm
with z counted downwards has -.2 in its last entry, which flips the sign of both off-diagonals.
"""

from collections.abc import Callable

import numpy as np
import pytest

from wbc import Robot, load_robot, metrics
from wbc.dynamics import evaluate

POSE = {"hip": -np.pi / 6, "knee": np.pi / 3}
UP = (0.0, 1.0)
FIXED, FLOATING = load_robot("planar_leg_fixed"), load_robot("planar_leg")
AT = FLOATING.configuration(**POSE)
LAST_DIGIT = 0.5001e-6  # the reference is printed with six decimals


def close(value: object, reference: object) -> None:
    np.testing.assert_allclose(np.asarray(value), np.asarray(reference), rtol=0, atol=LAST_DIGIT)


def test_link_inertia_and_jacobian() -> None:
    terms = evaluate(FIXED, FIXED.configuration(**POSE), np.zeros(2))
    close(terms.mass_matrix, [[0.693333, 0.186667], [0.186667, 0.106667]])
    np.testing.assert_allclose(
        terms.contact_jacobian[[0, 2]], [[-0.69282, -0.34641], [0.0, 0.2]], rtol=0, atol=5.1e-6
    )
    close(FIXED.transmission.reflected_inertia, [0.026667, 0.026667])
    close(FIXED.transmission.backward_efficiency, [0.75, 0.571429])


@pytest.mark.parametrize(
    ("robot", "tensor", "expected"),
    [
        (FIXED, metrics.generalized_inertia, [1.5, 1.250926, 1.250926, 3.166667]),
        (FIXED, metrics.backward_generalized_inertia, [1.518519, 1.283001, 1.283001, 3.722222]),
        (FIXED, metrics.forward_generalized_inertia, [1.861111, 1.539601, 1.299038, 3.809524]),
        (FLOATING, metrics.generalized_inertia, [1.459986, 1.192464, 1.192464, 3.075178]),
        (FLOATING, metrics.backward_generalized_inertia, [1.476302, 1.202408, 1.202408, 3.545989]),
    ],
)
def test_inertia_tensors(
    robot: Robot, tensor: Callable[..., object], expected: list[float]
) -> None:
    found = tensor(robot, robot.configuration(**POSE), "foot", "xz")
    close(np.ravel(np.asarray(found)), expected)


@pytest.mark.parametrize("robot", [FLOATING, FIXED])
def test_force_capability(robot: Robot) -> None:
    reach = metrics.force_capability(robot, robot.configuration(**POSE), "foot", "xz").along(UP)
    assert reach.conventional == pytest.approx(100.0, abs=1e-9)
    assert reach.lift / reach.conventional == pytest.approx(0.7, abs=1e-12)
    assert reach.hold / reach.conventional == pytest.approx(1.75, abs=1e-12)


def test_impact_mitigation() -> None:
    gears = FLOATING.transmission
    bare = FLOATING.with_transmission(gears.replace(rotor_inertia=np.zeros(2)))
    close(metrics.impact_mitigation(bare, AT, "foot", "xz").along(UP), 0.925374)
    close(metrics.impact_mitigation(FLOATING, AT, "foot", "xz", directions=0).along(UP), 0.888639)
    close(metrics.impact_mitigation(FLOATING, AT, "foot", "xz").along(UP), 0.863972)


def test_equal_efficiencies() -> None:
    eta = {"forward_efficiency": [0.9, 0.8, 0.7, 0.6, 0.55, 0.51]}
    designs = metrics.Designs.of(FLOATING, AT, eta)
    table = metrics.design_metrics(designs, "foot", UP, "xz")
    close(table.impact_mitigation, [0.884290, 0.877152, 0.863272, 0.824509, 0.757585, 0.465668])
    hold, lift = table.hold / table.conventional, table.lift / table.conventional
    np.testing.assert_allclose(hold, [1.125, 4 / 3, 1.75, 3.0, 5.5, 25.5], rtol=1e-9)
    np.testing.assert_allclose(lift, eta["forward_efficiency"], rtol=1e-9)


def test_the_paper_s_motors_cannot_carry_the_leg() -> None:
    weight = 9.81 * sum(inertia.mass for inertia in FLOATING.model.inertias)
    assert weight == pytest.approx(186.39)
    assert metrics.force_capability(FLOATING, AT, "foot", "xz").along(UP).hold < weight
    strong = load_robot("planar_leg_strong")
    assert metrics.force_capability(strong, AT, "foot", "xz").along(UP).lift > weight
