"""The search: causes give way to the one that they imitate, and unlikely numbers cost."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from wbc.effects import (
    EFFECTS,
    Backlash,
    CenterOfMass,
    CoulombFriction,
    CurrentLimit,
    JointCompliance,
    JointSpring,
    LinkInertia,
    LinkInertias,
    LoadFriction,
    PayloadMass,
    StribeckFriction,
    SupplySag,
    ThermalDrift,
    TorqueConstant,
    TorqueOffset,
    TorqueRipple,
    TransmissionEfficiency,
    ViscousFriction,
    load_robot,
)
from wbc.effects.formula import CustomTorque
from wbc.effects.friction import RotorCoulombFriction
from wbc.effects.links import add_point_mass
from wbc.errors import DynamicsError
from wbc.identification import diagnose
from wbc.identification.answer.model_to_use import judged
from wbc.identification.choice import gears, search
from wbc.identification.choice.certainty import EVEN, Odds, odds_of, support_of
from wbc.identification.choice.evidence import density_gained, implausible
from wbc.identification.choice.gears import two_gears
from wbc.identification.choice.plain_models import plain_fits
from wbc.identification.choice.proposals import Proposer
from wbc.identification.choice.screen import CauseScreen
from wbc.identification.choice.search import Search, _drops
from wbc.identification.choice.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.yielding import deflects
from wbc.robot import Effect, Evidence, Motion
from wbc.sim.excitation import record_with

AT_ONCE = tuple(kind for kind in EFFECTS.values() if not deflects(kind))

LEG = load_robot("planar_leg_fixed").lossless()


def test_two_gears_are_sought_behind_a_link_of_little_inertia(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The softest gear that can be stated is stiffer than the slowest of the grid: an error."""

    def flies_off(*_: object, **__: object) -> None:
        raise DynamicsError("not simulated here")

    shin = LEG.velocity_index("knee") + 1
    mass = LEG.model.inertias[shin]
    light = LEG.with_inertia(shin, pin.Inertia(1e-3 * mass.mass, mass.lever, 1e-3 * mass.inertia))
    problem = EstimationProblem.from_logs(light, record_with(LEG, [], duration=2.0)[:1])
    monkeypatch.setattr(gears, "evaluate", flies_off)
    monkeypatch.setattr(gears, "_left", lambda links, *_, **__: np.zeros(len(links)))
    assert two_gears(Trials(problem), [JointCompliance, Backlash]) == []


def test_a_plain_fit_holds_friction_that_falls_over_all_speeds() -> None:
    """A classic fit has viscous friction below zero there, which no joint of a robot can have."""
    hidden = [CoulombFriction("hip", 1.0), StribeckFriction("hip", 1.0, 2.0)]
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, hidden, duration=4.0))
    *_, before, falling = plain_fits(Trials(problem), tuple(EFFECTS.values()))
    assert falling.error < 1.1
    assert before.error > 2.0 * falling.error


def test_springs_of_a_screen_differ_where_the_joint_moves() -> None:
    """About zero and one they were alike at 3 rad: an arm's spring was a centre of mass."""
    position = np.stack([np.zeros(50), np.linspace(2.7, 3.3, 50)], axis=1)
    motion = Motion(position, np.zeros((50, 2)), np.zeros((50, 2)))
    (screen,) = JointSpring.search.screens(JointSpring, LEG, "knee", Evidence((motion,), (), ()))
    made = [JointSpring.at("knee", unit).joint_torque(LEG, motion)[:, 1] for unit in screen.units]
    assert np.corrcoef(*made)[0, 1] == pytest.approx(1.0)
    assert abs(made[0] @ made[1]) < 0.5 * np.linalg.norm(made[0]) * np.linalg.norm(made[1])
    both = JointSpring.at("knee", screen.combine(np.array([2.0, 0.5])))
    np.testing.assert_allclose(both.joint_torque(LEG, motion)[:, 1], 2.0 * made[0] + 0.5 * made[1])


def test_a_rotor_inertia_is_no_tonne_beside_the_axis() -> None:
    """It was tied with 400 kg at the first link of an arm."""
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, [], duration=2.0)[:1])
    heavy = PayloadMass("thigh", 20.0 * sum(inertia.mass for inertia in LEG.model.inertias))
    assert sum(implausible(problem, problem.fit([heavy], 0))) > 6.0


def test_a_limit_that_leaves_most_is_not_believed() -> None:
    """Derivatives, followed to a limit without end, said that it explains 7e13 floors."""
    cubic = CustomTorque.at("hip", {"v_hip * v_hip * v_hip": -0.03})
    trials = Trials(EstimationProblem.from_logs(LEG, record_with(LEG, [cubic])))
    limit = trials.of((CurrentLimit("hip", 15.0),))
    assert limit is not None
    assert judged(trials, limit).support["current_limit", "hip"].belief < EVEN
    assert () in [h.effects for h in _drops(Proposer(trials, AT_ONCE), limit)]


HIDDEN: dict[str, list[Effect]] = {
    "a lossy gear is no load friction with a wrong torque constant": [
        TransmissionEfficiency("knee", 0.8, 0.9),
        CoulombFriction("hip", 0.5),
    ],
    # A recorded arm was said to have a backward efficiency of 0.63 with 0.97.
    "a weak drive with friction is no lossy gear": [
        TorqueConstant("knee", 0.85),
        CoulombFriction("knee", 0.4),
    ],
    "nor is a strong one": [TorqueConstant("knee", 1.1), CoulombFriction("knee", 0.6)],
    "causes that no other explains stay": [
        LoadFriction("hip", 0.1),
        SupplySag("robot", 2e-3),
        TorqueConstant("knee", 0.8),
    ],
}


@pytest.mark.parametrize("name", HIDDEN)
def test_the_search_ends_at_what_is_hidden(name: str) -> None:
    hidden = HIDDEN[name]
    trials = Trials(EstimationProblem.from_logs(LEG, record_with(LEG, hidden, duration=4.0)))
    begun = trials.of(tuple(hidden) if "stay" in name else ())
    assert begun is not None
    end = Search(Proposer(trials, AT_ONCE)).climb(begun)
    assert set(end.keys) == {effect.key for effect in hidden}


def test_friction_of_a_rotor_is_that_of_its_joint_once_its_gear_loses_nothing() -> None:
    """Two names for one torque shared its odds, and losses of 0.04 % were kept for one of them."""
    rubs, loses = RotorCoulombFriction("hip", 0.5), TransmissionEfficiency("hip", 0.9, 0.9)
    trials = Trials(
        EstimationProblem.from_logs(LEG, record_with(LEG, [CoulombFriction("hip", 0.5)]))
    )
    both = trials.of((rubs, loses))
    assert both is not None
    assert ("rotor_coulomb_friction", "hip") in both.keys
    (alone,) = trials.rivals_of(both, [(rubs,)])
    assert alone.keys == (("coulomb_friction", "hip"),)
    assert alone.effects[0].values["level"] == pytest.approx(0.5, rel=0.02)


def test_tiny_causes_are_not_what_explains_the_logs() -> None:
    """Beside a payload that explained a quadruped two lighter calves were 97 and 98 % sure."""
    hidden = [CoulombFriction("hip", 0.5), TorqueOffset("hip", 0.01), TorqueOffset("knee", 0.01)]
    trials = Trials(EstimationProblem.from_logs(LEG, record_with(LEG, hidden, duration=4.0)))
    for causes, explained in ((hidden, [True, False, False]), (hidden[:2], [True, True])):
        found = trials.of(causes)
        assert found is not None
        support = support_of(trials, found, odds_of(trials, found), np.zeros(2))[0]
        assert [own.explained for own in support.values()] == explained


def test_what_a_doubted_cause_explains_counts_as_left() -> None:
    """Else what stands in for something unknown makes the names beside it certain."""
    friction, drag = CoulombFriction("hip", 0.5), ViscousFriction("hip", 0.5)
    trials = Trials(
        EstimationProblem.from_logs(LEG, record_with(LEG, [friction, drag], duration=4.0))
    )
    both, alone = trials.of((friction, drag)), trials.of((friction,))
    assert both is not None
    assert alone is not None
    left, missing = [], []
    for share in (0.9, 0.1):
        odds = Odds((both, alone), (0.0, 0.0), (share, 1.0 - share))
        support, more = support_of(trials, both, odds, np.zeros(2))
        left.append(support[friction.key].remainder)
        missing.append(more)
    assert missing == [False, True]
    assert left[0] < 0.02
    # As much as is left where the other is not even fitted, over what the first explains then.
    without = support_of(trials, alone, odds, np.maximum(alone.outputs - 1.0, 0.0))[0]
    assert left[1] == pytest.approx(without[friction.key].remainder, rel=0.05)


@pytest.mark.parametrize(("nats", "moved"), [(2.0, False), (4.0, True)])
def test_what_is_not_told_apart_is_not_exchanged(
    nats: float, moved: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A recorded arm went to and fro between two frictions for half of its search."""
    here = SimpleNamespace(effects=(CoulombFriction("hip", 1.0),), error=1.0)
    other = SimpleNamespace(effects=(ViscousFriction("hip", 1.0),), error=1.0, believable=True)
    trials: Any = SimpleNamespace(
        problem=None, rivals_of=lambda *_: [other], best_of=lambda several: several[-1]
    )
    proposer: Any = SimpleNamespace(trials=trials, exchanges=lambda *_: [other.effects])
    monkeypatch.setattr(search, "_drops", lambda *_: [])
    monkeypatch.setattr(search, "left_to_gain", lambda *_: np.inf)
    monkeypatch.setattr(search, "weigh", lambda _, several: np.array([0.0, nats]))
    monkeypatch.setattr(Search, "_addition", lambda *_: None)
    monkeypatch.setattr(Search, "_pair", lambda *_: None)
    begun: Any = here
    assert (Search(proposer)._next(begun) is other) == moved


def test_a_factor_acts_after_the_sag_that_it_follows() -> None:
    """In the other order the sag was 15 % off, and more was left than the sensors' noise."""
    hidden = [SupplySag("robot", 2e-3), TorqueConstant("hip", 1.2), CoulombFriction("knee", 0.4)]
    trials = Trials(EstimationProblem.from_logs(LEG, record_with(LEG, hidden, duration=4.0)))
    end = Search(Proposer(trials, AT_ONCE)).climb(trials.nothing)
    drives = [effect for effect in end.effects if "drive" in effect.acts_by]
    assert [effect.name for effect in drives] == ["supply_sag", "torque_constant"]
    assert drives[0].values["coefficient"] == pytest.approx(2e-3, rel=0.05)


def test_a_drawing_costs_by_how_wrong_it_is_over_all_its_links() -> None:
    """Six links as wrong as usual are no surprise; each on its own cost a quarter of a nat."""
    own = {name: 0.5 * (-1) ** k for k, name in enumerate(LinkInertia.null_values(LEG, "shin"))}
    one = LinkInertias.at("robot", {f"shin.{name}": value for name, value in own.items()})
    null = LinkInertias.null_values(LEG, "robot")
    every = LinkInertias.at("robot", {name: own[name.rpartition(".")[2]] for name in null})
    cost = one.search.implausibility(one, LEG, ())
    assert every.search.implausibility(every, LEG, ()) == pytest.approx(cost)
    assert cost > 1.0


def test_what_only_the_first_second_shows_is_no_drift_with_time() -> None:
    """On a recorded arm friction that changed in the first second was called a warm motor."""
    start = ThermalDrift("hip", rate=-0.3, time_constant=1.2)
    logs = record_with(LEG, [CoulombFriction("hip", 0.5), start], duration=6.0)
    diagnosis = diagnose(LEG, logs, [ThermalDrift, CoulombFriction])
    assert "thermal_drift" not in [effect.name for effect in diagnosis.effects]


def test_what_is_only_explained_by_impossible_numbers_is_not_named() -> None:
    """A drive whose report is a seventh of the truth is beyond what a torque constant may be."""
    name, logs = "hip.rotor_torque", record_with(LEG, [CoulombFriction("hip", 0.5)], duration=3.0)
    weak = [log.with_columns({name: log.column(name) / 7.0}) for log in logs]
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


def test_a_screen_says_what_fits_leave() -> None:
    """Beside causes known already, and in the place of one of them; of one cause and of two."""
    hidden = [CoulombFriction("hip", 0.5), ViscousFriction("knee", 0.3)]
    logs = record_with(LEG, [*hidden, ViscousFriction("hip", 0.02)], duration=3.0)
    problem = EstimationProblem.from_logs(LEG, logs)
    trials, own = Trials(problem), ViscousFriction("hip", 0.1)
    h = trials.of((own,))
    assert h is not None
    offered = (CoulombFriction, ViscousFriction)
    screen = CauseScreen.of(problem, h, trials.fit(h), offered, trials.failures)
    numbers = {regressor.key: k for k, regressor in enumerate(screen.regressors)}
    pair = tuple(numbers[effect.key] for effect in hidden)
    told = [
        (screen.ranked((), [own.key], 9)[0], h.effects),
        (screen.ranked((own,), [own.key], 9)[0], ()),
        (screen.together([pair], 1)[0], h.effects),
    ]
    for one, kept in told:
        fit = problem.fit([*kept, *one.added])
        here, left = (np.mean(f.residual**2, axis=0) for f in (trials.fit(h), fit))
        samples = problem.white_samples if kept else h.samples
        (gained,) = density_gained(problem, h, here, left[None], samples)
        assert one.density == pytest.approx(gained, rel=1e-3)
        for effect, same in zip(one.added, fit.effects[len(kept) :], strict=True):
            assert effect.values == pytest.approx(same.values, rel=1e-2)
