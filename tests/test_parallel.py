"""Many jobs in several processes, and how far they are."""

import os
import signal

import pytest

from wbc.errors import ParallelError
from wbc.parallel import progress_lines, run_jobs, spoken_time


def squared(number: int) -> int:
    """Return the square of a number; the shortest of jobs."""
    return number * number


def test_results_come_in_the_order_of_the_items() -> None:
    assert list(run_jobs(squared, range(20), workers=2)) == [k * k for k in range(20)]
    with pytest.raises(ParallelError, match="workers is 0"):
        list(run_jobs(squared, [1], workers=0))


def failing(number: int) -> int:
    """Raise for one of the jobs, end the process of another."""
    if number == 3:
        raise ValueError("job 3")
    if number == 107:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.mark.parametrize(
    ("first", "error", "says"),
    [(0, ValueError, "job 3"), (100, ParallelError, "ended the process")],
)
def test_a_job_that_fails_ends_the_work_and_the_next_work_runs(
    first: int, error: type[Exception], says: str
) -> None:
    with pytest.raises(error, match=says):
        list(run_jobs(failing, range(first, first + 20), workers=2))
    assert list(run_jobs(squared, range(4), workers=2)) == [0, 1, 4, 9]


def test_a_line_every_half_minute_tells_the_time_left() -> None:
    now = 0.0
    lines: list[str] = []
    watch = progress_lines("sessions", lines.append, lambda: now)
    watch(20, 100)  # what an earlier run left took no time
    for done in range(21, 101):
        now += 10.0
        watch(done, 100)
    assert lines[0] == "sessions: 23 of 100, 13 min left"  # 77 of 10 s each
    assert lines[-1] == "sessions: 98 of 100, 20 s left"
    assert len(lines) == 26  # every 30 s, not at the end
    spoken = [spoken_time(t) for t in (0.4, 119, 120, 7300, 200000)]
    assert spoken == ["0 s", "119 s", "2 min", "2 h", "2 d"]
