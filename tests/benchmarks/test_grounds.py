"""The block in flight, on a slope and at a stair: scenes mean the same in every engine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.grounds import SCENES, depth, energy, mujoco_track, wbc_track

TRACKS = {"wbc": wbc_track, "MuJoCo": mujoco_track}


@pytest.mark.parametrize("scene", ["flight", "slide"])
def test_engines_agree_within_their_own_errors(scene):
    short = replace(SCENES[scene], time=0.05)
    ours, theirs = (track(short) for track in TRACKS.values())
    np.testing.assert_allclose(ours[0], theirs[0], atol=5e-4)
    np.testing.assert_allclose(ours[1], theirs[1], atol=5e-3)
    np.testing.assert_allclose(energy(short, ours), energy(short, theirs), rtol=5e-3, atol=5e-3)


def test_a_stair_stops_the_block_and_gives_no_energy():
    short = replace(SCENES["stair"], time=0.3)
    track = wbc_track(short)
    books = energy(short, track)
    assert track[0][:, 0].max() < 0.3 - 0.09  # the riser at 0.3 less half the block, which tips
    assert np.diff(books).max() < 1e-5 * books[0]
    assert depth(short, track) < 1e-6
