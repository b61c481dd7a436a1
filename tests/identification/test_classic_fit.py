"""The classic fit finds what is hidden, says what its numbers are sums of, and holds out."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.effects import CoulombFriction, PayloadMass, TorqueOffset, ViscousFriction, load_robot
from wbc.identification.classic import ClassicFit, base_columns, identify
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()
HIDDEN = (
    ViscousFriction("hip", 0.3),
    CoulombFriction("knee", 0.4),
    TorqueOffset("knee", -0.2),
    PayloadMass("foot", 0.3),
)


@pytest.fixture(scope="module")
def fit() -> ClassicFit:
    return identify(LEG, record_with(LEG, list(HIDDEN), duration=4.0))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("viscous_friction at hip", 0.3),
        ("viscous_friction at knee", 0.0),
        ("coulomb_friction at hip", 0.0),
        ("coulomb_friction at knee", 0.4),
        ("torque_offset at knee", -0.2),
    ],
)
def test_friction_and_offsets_are_found(fit: ClassicFit, name: str, value: float) -> None:
    (found,) = [p for p in fit.parameters if p.name == name]
    assert found.value == pytest.approx(value, abs=0.02)


def test_what_is_left_is_noise_although_it_is_held_out(fit: ClassicFit) -> None:
    assert fit.joints == ("hip", "knee")
    assert np.all(fit.left < 0.05 * fit.before)


def test_base_parameters_hold_the_payload(fit: ClassicFit) -> None:
    # The shin's first moment grows by mass times the length of the shin, whatever else is in it.
    moments = [p for p in fit.parameters if p.name.startswith("m") and p.name.endswith("shin")]
    grown = max(abs(p.value - p.given) for p in moments)
    shin = float(
        np.linalg.norm(LEG.model.frames[LEG.model.getFrameId("foot")].placement.translation)
    )
    assert grown == pytest.approx(0.3 * shin, rel=0.05)


def test_columns_that_depend_on_others_are_written_as_their_sums() -> None:
    random = np.random.default_rng(3)
    free = random.normal(size=(40, 3))
    mixing = np.array([[1.0, 0.0], [-2.0, 0.5], [0.0, 3.0]])
    matrix = np.column_stack([free[:, 0], free[:, 1], free[:, 2], free @ mixing])
    kept, found = base_columns(matrix)
    assert kept == [0, 1, 2]
    np.testing.assert_allclose(found, mixing, atol=1e-9)
