"""The sets of variables that the benchmark compares are one program."""

from __future__ import annotations

from benchmarks.formulations import measure


def test_every_set_of_variables_gives_the_same_accelerations():
    found = measure(ticks=30)
    assert len(found) == 8
    sizes = {name: rows[0, 3] for (name, _), rows in found.items()}
    assert sizes == {
        "accelerations, forces": 48,
        "contacts' null space, forces": 36,
        "accelerations, forces, torques": 78,
        "torques, forces": 42,
    }
    for contestant, rows in found.items():
        assert rows[:, 2].max() < 1e-4, contestant
