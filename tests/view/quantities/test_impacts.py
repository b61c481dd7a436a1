"""Impacts are found where a contact closes hard, and only there."""

from __future__ import annotations

import numpy as np

from wbc.view.channels import find_impacts

TIME = np.arange(0.0, 1.0, 1e-3)
WEIGHT = 100.0


def vertical(*pieces: tuple[float, float, float]) -> np.ndarray:
    force = np.zeros((len(TIME), 3))
    for start, stop, size in pieces:
        force[(start <= TIME) & (stop > TIME), 2] = size
    return force


def test_standing_from_the_start_is_no_impact() -> None:
    assert find_impacts(TIME, {"foot": vertical((0.0, 1.0, WEIGHT))}, WEIGHT) == ()


def test_landings_are_found_whatever_their_size() -> None:
    force = vertical((0.1, 0.103, 30.0 * WEIGHT), (0.103, 0.5, WEIGHT), (0.6, 1.0, 1.2 * WEIGHT))
    impacts = find_impacts(TIME, {"foot": force}, WEIGHT)
    np.testing.assert_allclose([impact.time for impact in impacts], [0.1, 0.6], atol=1e-9)
    np.testing.assert_allclose([impact.force for impact in impacts], [3000.0, 120.0])


def test_chatter_of_a_millisecond_is_one_impact() -> None:
    force = vertical((0.1, 0.11, 500.0), (0.112, 0.12, 400.0), (0.122, 1.0, WEIGHT))
    assert len(find_impacts(TIME, {"foot": force}, WEIGHT)) == 1


def test_a_foot_put_down_gently_is_no_impact() -> None:
    force = vertical()
    force[:, 2] = np.clip(TIME - 0.2, 0.0, 0.3) / 0.3 * 0.5 * WEIGHT
    other = vertical((0.0, 1.0, 0.5 * WEIGHT))
    assert find_impacts(TIME, {"left": force, "right": other}, WEIGHT) == ()
