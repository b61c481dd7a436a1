"""The classic fit finds what is hidden, says what its numbers are sums of, and holds out."""

import numpy as np
import pytest

from wbc.effects import CoulombFriction, PayloadMass, TorqueOffset, ViscousFriction, load_robot
from wbc.identification.classic import identify
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()
HIDDEN = [ViscousFriction("hip", 0.3), CoulombFriction("knee", 0.4), TorqueOffset("knee", -0.2)]


def test_the_classic_fit_finds_friction_offsets_and_the_payload() -> None:
    fit = identify(LEG, record_with(LEG, [*HIDDEN, PayloadMass("foot", 0.3)], duration=4.0))
    found = {p.name: p.value for p in fit.parameters}
    true = {f"{e.name} at {e.where}": value for e in HIDDEN for value in e.values.values()}
    true |= {"viscous_friction at knee": 0.0, "coulomb_friction at hip": 0.0}
    for name, value in true.items():
        assert found[name] == pytest.approx(value, abs=0.02), name
    # The shin's first moment grows by mass times the length of the shin, whatever else is in it.
    moments = [p for p in fit.parameters if p.name.startswith("m") and p.name.endswith("shin")]
    grown = max(abs(p.value - p.given) for p in moments)
    foot = LEG.model.frames[LEG.model.getFrameId("foot")].placement
    assert grown == pytest.approx(0.3 * np.linalg.norm(foot.translation), rel=0.05)
    # What is left is noise, although it is held out.
    assert fit.joints == ("hip", "knee")
    assert np.all(fit.left < 0.05 * fit.before)
