"""What numbers cost that no machine is likely to have: smooth where it can be, in nats."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.effects import (
    CenterOfMass,
    CoulombFriction,
    LinkInertia,
    LinkInertias,
    ThermalDrift,
    TorqueConstant,
    TorqueRipple,
    load_robot,
)
from wbc.effects.link_inertias import lower
from wbc.effects.links import add_point_mass
from wbc.identification import diagnose
from wbc.identification.choice.prior import implausible
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()


def test_a_drawing_costs_by_how_wrong_it_is_over_all_its_links() -> None:
    """Six links as wrong as usual are no surprise; each on its own cost a quarter of a nat."""
    own = {name: 0.5 * (-1) ** k for k, name in enumerate(LinkInertia.null_values(LEG, "shin"))}
    one = LinkInertia.at("shin", own)
    null = LinkInertias.null_values(LEG, "robot")
    every = LinkInertias.at("robot", {name: own[name.rpartition(".")[2]] for name in null})
    assert every.search.implausibility(every, LEG, ()) == pytest.approx(
        one.search.implausibility(one, LEG, ())
    )
    factor = lower(list(one.values.values()))
    changed = factor @ factor.T
    divergence = np.trace(changed) - np.linalg.slogdet(changed)[1] - 4.0
    times = np.sqrt(divergence / 10.0) / 0.2
    assert one.search.implausibility(one, LEG, ()) == pytest.approx(
        0.5 * (np.log(times) / 0.5) ** 2
    )
    assert one.search.implausibility(one, LEG, ()) > 1.0


def test_what_only_the_first_second_shows_is_no_drift_with_time() -> None:
    """On a recorded arm friction that changed in the first second was called a warm motor."""
    start = ThermalDrift("hip", rate=-0.3, time_constant=1.2)
    logs = record_with(LEG, [CoulombFriction("hip", 0.5), start], duration=6.0)
    diagnosis = diagnose(LEG, logs, [ThermalDrift, CoulombFriction])
    assert "thermal_drift" not in [effect.name for effect in diagnosis.effects]


def test_what_is_only_explained_by_impossible_numbers_is_not_named() -> None:
    """A drive whose report is a seventh of the truth is beyond what a torque constant may be."""
    logs = record_with(LEG, [CoulombFriction("hip", 0.5)], duration=3.0)
    weak = [
        log.with_columns({"hip.rotor_torque": log.column("hip.rotor_torque") / 7.0}) for log in logs
    ]
    diagnosis = diagnose(LEG, weak, [TorqueConstant, CoulombFriction])
    assert diagnosis.verdict == "unknown"
    believed = [f.effect.name for f in diagnosis.findings if f.probability >= 0.5]
    assert "torque_constant" not in believed


def test_a_point_mass_that_grew_reaches_as_far_as_its_point() -> None:
    """Of a recorded servo's pendulum: its moments about the centre are zero, or -2e-18 kg m^2."""
    given = load_robot("xl330_pendulum")
    shift = CenterOfMass("arm", 0.0, 0.0, 0.01)
    asked = shift.search.implausibility(shift, given, ())
    for added in np.linspace(0.01, 0.3, 30):
        heavier = add_point_mass(given.model.inertias[1], float(added), np.array([0.0, 0.0, -0.1]))
        robot = given.with_inertias({1: heavier})
        with np.errstate(invalid="raise"):
            assert shift.search.implausibility(shift, robot, ()) == pytest.approx(asked)


@pytest.mark.parametrize(("order", "believed"), [(1.5, False), (9.0, True)])
def test_a_fit_with_less_than_a_period_is_not_believed(order: float, believed: bool) -> None:
    ripple = TorqueRipple("hip", 0.5, order, 0.3)
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, [ripple], duration=3.0))
    fit = problem.fit([ripple])
    assert fit.effects[0].values["order"] == pytest.approx(order, rel=0.1)
    assert (sum(implausible(problem, fit)) < 1.0) is believed
