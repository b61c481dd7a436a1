"""How hypotheses are compared: one number in nats, held against formulas and drawn noise."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from wbc.effects import ActuationDelay, Backlash, ContactRadius, CoulombFriction, load_robot
from wbc.identification.choice.certainty import CERTAIN, EVEN, Support, odds_of
from wbc.identification.choice.evidence import Hypothesis, left_to_gain, log_densities, weigh
from wbc.identification.choice.search import Search
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.robot import Effect


def begun_at(*first: float) -> SimpleNamespace:
    """Return logs on which the robot as given leaves these mean squares, in floors."""
    excess = np.array(first) - 1.0
    return SimpleNamespace(distorted=lambda share: share**2 * excess)


PROBLEM = begun_at(1.0)
FRICTION, PLAY = CoulombFriction("hip", 0.5), Backlash("knee", 0.04, 2e3, 10.0)


def hypothesis(
    left: float | tuple[float, ...], prior: float = 0.0, effects: tuple[Effect, ...] = ()
) -> Hypothesis:
    """Return what leaves these mean squares on each of five folds of 100 rows, 40 samples each."""
    folds = np.broadcast_to(np.atleast_1d(left), 5).astype(float)[:, None]
    samples, rows = np.array([0.4]), np.full(5, 100.0)
    return Hypothesis(effects, folds, folds, 0.0, folds[:, 0], samples, rows, -prior, ())


@pytest.mark.parametrize(
    ("small", "large"),
    [
        (ContactRadius("foot", 0.0015), ContactRadius("foot", 0.006)),
        (ActuationDelay("hip", 2.5e-4), ActuationDelay("hip", 1e-3)),
    ],
)
def test_what_every_machine_is_off_by_is_not_named(small: Effect, large: Effect) -> None:
    """Balls that sink in by a millimetre, and torques that are read a tenth of a sample early."""
    for effect, certain in ((small, False), (large, True)):
        off = effect.search.tolerated(effect, load_robot("planar_leg"), 0.002)
        support = Support(1.0, 1.0, 0.01, 0.0, explained=True, tolerated=off)
        assert (support.probability >= CERTAIN) is certain
        assert (support.probability < EVEN) is not certain
        assert support.belief >= CERTAIN  # its torque is there all the same


def test_what_is_unlikely_at_one_joint_does_not_hide_it_at_others() -> None:
    """A recorded arm: presliding at five joints at once, 458 nats, was given up for one of them."""
    knee, ankle = (CoulombFriction(joint, 0.5) for joint in ("knee", "ankle"))
    known = hypothesis(4.0, effects=(PLAY,))
    longer = replace(
        hypothesis(1.0, effects=(PLAY, FRICTION, knee, ankle)), implausible=(0, 0, 9, 2)
    )
    assert not longer.believable

    def tried_beside(found: Hypothesis) -> list[tuple[Effect, ...]]:
        """Return what is fitted after a group of causes was found."""
        rounds: list[list[tuple[Effect, ...]]] = []

        def rivals_of(h: Hypothesis, offers: list[tuple[Effect, ...]]) -> list[Hypothesis]:
            rounds.append(offers)
            return [found] if len(rounds) == 1 else []

        trials = SimpleNamespace(rivals_of=rivals_of, best_of=lambda group: group[0])
        proposer = SimpleNamespace(trials=trials, beside=lambda *_: [])
        assert Search(proposer)._addition(known) is None  # type: ignore[arg-type]
        return rounds[1]

    assert tried_beside(longer) == [(PLAY, FRICTION, ankle)]
    assert tried_beside(replace(longer, implausible=(0, 9, 9, 9))) == []
    assert tried_beside(replace(longer, implausible=(0, 0, 2, 2))) == []


def test_less_in_every_fold_is_never_less_evidence() -> None:
    """A recorded bench: 387 nats against what left a third to a half in every fold."""
    floors = (0.0, 0.0, 4.9, 12.3, 18.5), (0.0, 0.0, 1.3, 3.4, 9.9)
    two = [hypothesis(tuple(x**2 for x in left)) for left in floors]
    one, other = weigh(PROBLEM, two)  # type: ignore[arg-type]
    assert other > one


def test_more_rows_do_not_average_out_what_filters_distort() -> None:
    """An efficiency of 0.998 was certain on three long logs: it took up what filters distort."""
    rough = begun_at(1e4)  # 1 % of it (rms) is one floor

    def gain(before: float, after: float, rows: float) -> float:
        two = [replace(hypothesis(left), rows=np.full(5, rows)) for left in (before, after)]
        one, other = weigh(rough, two)  # type: ignore[arg-type]
        return other - one

    most = 0.01 / 0.1**2  # what it explains over what may look like it, in squares
    assert gain(1.2, 1.19, 1e2) < gain(1.2, 1.19, 1e4) < gain(1.2, 1.19, 1e6) < most
    # A cause as large as all that is distorted is certain all the same.
    assert gain(2.2, 1.2, 1e4) > 20.0


def test_nothing_below_what_a_simulated_link_distorts_is_evidence() -> None:
    """Causes beside a link that bounces took up what its simulation leaves: 300 nats for none."""
    rough = begun_at(4001.0)  # 5 % of it (rms) are 10 floors^2
    alone, beside = hypothesis(9.0, effects=(PLAY,)), hypothesis(4.0, effects=(PLAY, FRICTION))
    one, other = weigh(rough, [alone, beside])  # type: ignore[arg-type]
    assert one == pytest.approx(other)
    worse, one = weigh(rough, [hypothesis(22.0, effects=(PLAY,)), beside])  # type: ignore[arg-type]
    assert one - worse == pytest.approx(100.0 * np.log(2.0))


def test_no_cause_is_worth_more_than_leaving_nothing() -> None:
    """Beside a spring that left 1.04 floors nine causes more were fitted: none could win."""
    rough = begun_at(4001.0)
    rough.white_samples = np.array([0.4])
    at_floor, above = (hypothesis(left, effects=(PLAY,)) for left in (9.0, 22.0))
    assert left_to_gain(rough, at_floor) == 0.0  # type: ignore[arg-type]
    assert left_to_gain(rough, above) == pytest.approx(100.0 * np.log(2.0))  # type: ignore[arg-type]
    assert left_to_gain(rough, hypothesis(9.0)) == np.inf  # type: ignore[arg-type]


def test_each_output_is_judged_with_the_samples_of_the_one_that_leaves_least_there() -> None:
    """One that leaves least of an output in floors said how slow another output's noise is."""

    def two(left: tuple[float, float], samples: tuple[float, float]) -> Hypothesis:
        folds = np.tile(left, (5, 1))
        rows = np.full(5, 100.0)
        return Hypothesis((), folds, folds, 0.0, folds[:, 0], np.array(samples), rows, 0.0, ())

    problem = begun_at(1.0, 1.0)
    loud, quiet = two((50.0, 4.0), (0.4, 0.01)), two((100.0, 1.0), (0.4, 0.4))
    both = log_densities(problem, [loud, quiet])  # type: ignore[arg-type]
    assert both[1, 1] - both[0, 1] == pytest.approx(0.5 * 200 * np.log(4.0))


def test_an_answer_that_is_not_believable_has_odds_all_the_same() -> None:
    """Dropping doubtful causes left numbers no machine has: a recorded arm ended in an error."""
    nothing, sick = hypothesis(2.0), hypothesis(1.0, -10.0, (FRICTION,))
    sick = replace(sick, implausible=(12.0,))
    trials = SimpleNamespace(problem=PROBLEM, known=[nothing, sick])
    odds = odds_of(trials, final=sick)  # type: ignore[arg-type]
    assert not sick.believable
    assert np.isfinite(odds.level(sick))


def test_an_effect_at_every_joint_may_imitate_what_sits_in_every_joint() -> None:
    """Rotor inertias at five of six joints imitated an unknown memory of friction: 0.996 each."""
    five = 4 * 5 / 6

    rotor, friction = (Support(1.0, 1.0, 1.1, five, False, expected=e) for e in (1.0, 2.0))
    assert rotor.probability < 0.95 < friction.probability  # which most robots have


@pytest.mark.parametrize("share", [0.8, 0.95])
def test_what_remembers_itself_is_fewer_samples(share: float) -> None:
    """First-order noise: the sum of its squared autocorrelations is known (Bartlett)."""
    rows, ones = 20000, np.ones((20000, 1))
    record = SimpleNamespace(rows=rows, weight=ones, condense=lambda values: ones)
    record.rate, record.stride, record.bandwidth = 3.0, 1, SimpleNamespace(residual=1.0)
    problem = object.__new__(EstimationProblem)
    object.__setattr__(problem, "records", (record, record))
    object.__setattr__(problem, "floor", SimpleNamespace(judged=[0]))
    white = np.random.default_rng(1).standard_normal((2 * rows, 1))
    noise = lfilter([1.0], [1.0, -share], white, axis=0)
    expected = (1.0 - share**2) / (1.0 + share**2)
    assert problem.independent_samples(noise)[0] == pytest.approx(expected, rel=0.15)
