"""When a follow-up has resolved a tie, by its definition on the page of experiments."""

from __future__ import annotations

import pytest

from benchmarks.experiments.judge import kept, settled


@pytest.mark.parametrize(
    ("nats", "true", "rivals"),
    [
        ([10.0, 4.0], True, ()),
        ([2.0, 4.0], True, (0,)),
        ([-2.0, 0.5], True, (0, 1)),
        ([-2.0, 2.0], True, (0,)),  # the second lies 4 nats behind the best
        ([-4.0, 5.0], False, (0,)),
        ([-1e9, -1e9], False, (0, 1)),  # the true cause is not believable
        ([1e9], True, ()),
    ],
)
def test_what_lies_within_three_nats_of_the_best_is_kept(
    nats: list[float], true: bool, rivals: tuple[int, ...]
) -> None:
    assert kept(nats) == (true, rivals)


def test_a_name_may_stay_where_no_motion_speaks_against_it() -> None:
    assert settled([2.0, 9.0], {"0": 1.0})
    assert not settled([2.0, 9.0], {"0": 8.0})
    assert not settled([-5.0], {"0": 1.0})  # the truth is lost
    assert settled([5.0], {})
