"""Whatever happens while causes are sought, the best answer so far remains."""

import signal
import time
from dataclasses import dataclass
from typing import Any, ClassVar, final

import numpy as np
import pytest

from wbc.arrays import FloatArray
from wbc.effects import Backlash, CoulombFriction, JointCompliance, ViscousFriction, load_robot
from wbc.identification import diagnose
from wbc.identification.answer import diagnose as answer
from wbc.identification.answer.words import verdict_sentence
from wbc.identification.choice import find_causes as search
from wbc.identification.choice.find_causes import find_causes
from wbc.identification.choice.trials import OutOfTime, Trials
from wbc.identification.model import estimation_problem
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.open_loop import open_loop
from wbc.links.driven_links import DrivenLinks
from wbc.measurement import Log
from wbc.robot import Effect, Motion, Parameter, Robot
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()
KEY = ("coulomb_friction", "hip")
ONE_TRIAL = 40  # simulations of one gear along a log, at most


@pytest.fixture(scope="module")
def logs() -> tuple[Log, ...]:
    return record_with(LEG, [CoulombFriction("hip", 0.7)], duration=3.0)


@dataclass(frozen=True)
class Bad(Effect):
    """An effect at the whole robot with an error in it."""

    size: float

    name = "broken"
    parameters: ClassVar = (Parameter("size", "1", 0.0, -1.0, 1.0, 0.1),)
    explanation = experiment = "None."

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        return ("robot",)

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        raise ZeroDivisionError("no torque")


@final
@dataclass(frozen=True)
class Boundless(Bad):
    """An effect whose torque is no number once it has a size."""

    name = "boundless"

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        return np.full(motion.velocity.shape, np.nan if self.size else 0.0)


@pytest.mark.parametrize("bad", [Bad, Boundless])
def test_an_effect_that_fails_is_left_out_and_named(
    bad: type[Effect], logs: tuple[Log, ...]
) -> None:
    diagnosis = diagnose(LEG, logs, [bad, CoulombFriction, ViscousFriction])
    assert [e.key for e in diagnosis.effects] == [KEY]
    if bad is Bad:
        assert any("broken: ZeroDivisionError: no torque" in text for text in diagnosis.warnings)


def test_a_search_without_time_says_so(logs: tuple[Log, ...]) -> None:
    diagnosis = diagnose(LEG, logs, budget=0.0)
    assert not any(finding.probability > 0.5 for finding in diagnosis.findings)
    assert diagnosis.error.after < 0.1 * diagnosis.error.before  # the plain fits, at least
    assert any("best answer so far" in text for text in diagnosis.warnings)


def test_gears_are_tried_as_long_as_there_is_time(
    logs: tuple[Log, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A diagnosis with 60 s took 88: neither a grid of gears nor a fit looked at the clock.

    Here the clock counts how often links were simulated.
    """
    follow, simulated = DrivenLinks.follow, 0

    def counted(*given: Any) -> Any:
        nonlocal simulated
        simulated += 1
        return follow(*given)

    problem = EstimationProblem.from_logs(LEG, logs)
    with monkeypatch.context() as patch:
        patch.setattr(DrivenLinks, "follow", counted)
        patch.setattr(time, "monotonic", lambda: float(simulated))
        found = find_causes(problem, [JointCompliance, Backlash], lambda line: None, until=10.0)
        assert found.stopped
        assert found.final is found.trials.nothing
        assert 10 < simulated < 10 + ONE_TRIAL
        trials = Trials(problem, until=simulated + 10.0)
        with pytest.raises(OutOfTime):
            trials.of([JointCompliance("hip", 100.0, 0.3)])
        assert simulated < 20 + 2 * ONE_TRIAL
        trials.answering = True
        assert trials.of([JointCompliance("knee", 100.0, 0.3)]) is None


def test_an_answer_does_without_simulated_logs_where_the_time_is_over(
    logs: tuple[Log, ...],
) -> None:
    assert "the time given was over" in open_loop(LEG, logs, until=time.monotonic()).reason


def test_an_interrupted_search_keeps_what_it_found_and_fits_nothing_more(
    logs: tuple[Log, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(line: str) -> None:
        if line.startswith("+ coulomb_friction"):
            interrupted.append(line)
        elif interrupted:
            monkeypatch.delattr(estimation_problem, "refine")
            raise KeyboardInterrupt

    interrupted: list[str] = []
    diagnosis = diagnose(LEG, logs, progress=interrupt)
    assert [e.key for e in diagnosis.effects] == [KEY]
    assert any("interrupted" in text for text in diagnosis.warnings)
    assert not any("left out" in text for text in diagnosis.warnings)


def test_a_diagnosis_that_is_interrupted_answers_soon(logs: tuple[Log, ...]) -> None:
    """Asked for: 2 s; it took 58 s of a large machine. Seconds of the processor, not of the clock,
    since others may use it."""
    begun: list[float] = []

    def stop(*_: object) -> None:
        begun.append(time.process_time())
        raise KeyboardInterrupt

    def soon(line: str) -> None:
        if "others in the place" in line and not begun:
            signal.setitimer(signal.ITIMER_REAL, 0.05)

    before = signal.signal(signal.SIGALRM, stop)
    try:
        found = diagnose(LEG, logs, progress=soon)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert time.process_time() - begun[0] < 2.0
    assert "interrupted" in found.warnings[0]


@pytest.mark.parametrize("place", ["retimed", "look_closer", "model_to_use", "describe_findings"])
def test_an_interrupt_at_any_time_after_the_search_is_answered(
    place: str, logs: tuple[Log, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the search and the answer, or while this was put into words, it took all away."""
    owner: Any = {"retimed": EstimationProblem, "look_closer": search}.get(place, answer)
    whole, asked = getattr(owner, place), []

    def interrupted(*given: Any, **more: Any) -> Any:
        asked.append(place)
        if len(asked) == 1:
            raise KeyboardInterrupt
        return whole(*given, **more)

    monkeypatch.setattr(owner, place, interrupted)
    found = diagnose(LEG, logs, [CoulombFriction, ViscousFriction])
    assert "interrupted" in found.warnings[0]
    assert "did not end by itself (it was interrupted)" in verdict_sentence(found)
    assert [effect.key for effect in found.effects] == [KEY]
