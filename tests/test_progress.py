"""Where there is no terminal, progress is a line now and then, with the time left."""

from __future__ import annotations

from wbc.progress import progress_lines, spoken_time


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


def test_short_work_writes_nothing() -> None:
    lines: list[str] = []
    watch = progress_lines("sessions", lines.append, lambda: 0.0)
    for done in range(11):
        watch(done, 10)
    assert lines == []


def test_times_are_told_in_the_largest_unit() -> None:
    assert [spoken_time(t) for t in (0.4, 119, 120, 7300, 200000)] == [
        "0 s",
        "119 s",
        "2 min",
        "2 h",
        "2 d",
    ]
