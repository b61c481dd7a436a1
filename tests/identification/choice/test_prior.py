"""What numbers cost that no machine is likely to have: smooth where it can be, in nats."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.effects import (
    CenterOfMass,
    CoulombFriction,
    LinkInertia,
    LinkInertias,
    PayloadMass,
    ThermalDrift,
    TorqueConstant,
    TransmissionEfficiency,
    load_robot,
)
from wbc.effects.links.pseudo_inertia import lower
from wbc.identification import diagnose
from wbc.identification.choice.weighing.prior import asked, implausible
from wbc.identification.choice.weighing.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.robot import Effect, Usual
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()


@pytest.fixture(scope="module")
def problem() -> EstimationProblem:
    return EstimationProblem.from_logs(
        LEG, record_with(LEG, [CoulombFriction("hip", 0.5)], duration=3.0)
    )


def cost(problem: EstimationProblem, effect: Effect) -> float:
    """Return the cost of one effect with just these numbers."""
    from wbc.identification.model.fit import refine

    fit = refine(problem.robot, [effect], problem.records, problem.whitening, iterations=0)
    return sum(implausible(problem, fit))


def test_numbers_of_a_drawing_that_the_logs_do_not_tell_cost_nothing(
    problem: EstimationProblem,
) -> None:
    """A leg in a plane shows four of the ten numbers of a link."""
    null = dict.fromkeys(LinkInertia.null_values(LEG, "shin"), 0.0)
    h = Trials(problem).of((CoulombFriction("hip", 0.5), LinkInertia.at("shin", null)))
    assert h is not None
    friction, drawing = h.untold
    assert friction == 0.0
    assert 6.0 < drawing < 10.0
    assert h.asked == pytest.approx(asked(h.effects) - drawing)


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


def test_drives_that_deliver_something_else_cost_by_the_factor(problem: EstimationProblem) -> None:
    costs = [cost(problem, TorqueConstant("hip", factor)) for factor in (1.0, 1.1, 2.0, 4.0)]
    # A torque constant, and what any drive costs that delivers so much more than it reports.
    spread = 0.5 * (0.2**-2 + 0.5**-2)
    assert costs == pytest.approx([spread * np.log(f) ** 2 for f in (1.0, 1.1, 2.0, 4.0)])


def test_a_center_of_mass_costs_that_is_shifted_by_much_of_its_link(
    problem: EstimationProblem,
) -> None:
    shin = LEG.bodies[-1]
    foot = LEG.model.frames[LEG.model.getFrameId("foot")].placement.translation
    reach = float(np.linalg.norm(foot))  # the foot is the farthest that is known of the shin
    shifts = np.array([0.0, 0.2, 1.0]) * reach
    costs = [cost(problem, CenterOfMass(shin, float(s), 0.0, 0.0)) for s in shifts]
    # A shift by the whole length is less likely than one in a thousand: no answer holds it.
    assert costs[:2] == pytest.approx([0.0, 0.5])
    assert costs[2] > 6.9


def test_a_mass_that_leaves_a_link_costs_and_one_that_is_added_does_not(
    problem: EstimationProblem,
) -> None:
    assert cost(problem, PayloadMass("foot", 1.5)) == pytest.approx(0.0)
    shin = LEG.bodies[-1]
    half, most = (cost(problem, PayloadMass(shin, -share * 2.0)) for share in (0.4, 0.9))
    assert half == pytest.approx(0.5 * (np.log(0.6) / 0.5) ** 2)
    assert most > 10.0


def test_an_efficiency_that_no_gear_has_is_not_believed(problem: EstimationProblem) -> None:
    usual = cost(problem, TransmissionEfficiency("hip", 0.8, 0.75))
    impossible = cost(problem, TransmissionEfficiency("hip", 0.8, -3.0))
    assert usual < 0.5
    assert impossible > 15.0


def test_what_is_usual_is_flat_in_its_range_and_falls_off_outside() -> None:
    plain, ratio = Usual(1.0, 2.0, 0.5), Usual(1.0, 2.0, 0.5, factor=True)
    assert [plain.cost(x) for x in (0.0, 1.0, 1.5, 2.0, 3.0)] == [2.0, 0.0, 0.0, 0.0, 2.0]
    assert ratio.cost(0.5) == pytest.approx(ratio.cost(4.0)) == 0.5 * (np.log(2.0) / 0.5) ** 2


def test_a_motor_warms_up_neither_in_a_second_nor_to_its_advantage(
    problem: EstimationProblem,
) -> None:
    usual = cost(problem, ThermalDrift("hip", rate=0.02, time_constant=10.0))
    short = cost(problem, ThermalDrift("hip", rate=0.02, time_constant=1.2))
    stronger = cost(problem, ThermalDrift("hip", rate=-0.3, time_constant=5.0))
    assert usual < 0.1
    assert short == pytest.approx(0.5 * (np.log(5.0 / 1.2) / 0.4) ** 2, rel=0.01)
    assert stronger > 6.9  # one in a thousand


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
