"""Pictures of a playback, through a real browser where there is one."""

import asyncio
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wbc.errors import ViewError
from wbc.view import write_animation, write_picture


@pytest.mark.usefixtures("chromium")
def test_a_picture_shows_force_and_direction_of_power(page: Path, tmp_path: Path) -> None:
    async def cell() -> Path:
        """A notebook runs a loop in its thread."""
        return write_picture(tmp_path / "squat.png", page, 0.45, size=(640, 480))

    picture = np.asarray(Image.open(asyncio.run(cell())).convert("RGB"))
    assert picture.shape == (480, 640, 3)
    scene = picture[110:360, 200:]
    assert np.any(np.abs(scene.astype(int) - (213, 94, 0)).max(axis=2) <= 40)  # it drives its motor
    assert (scene[..., 1].astype(int) - scene[..., 0] > 60).sum() > 100  # the force arrow


@pytest.mark.usefixtures("chromium")
def test_an_animation_moves_and_the_player_obeys(page: Path, tmp_path: Path) -> None:
    span, small = (0.3, 0.7), {"frame_rate": 10.0, "size": (320, 240)}
    film = Image.open(write_animation(tmp_path / "squat.gif", page, span, **small))
    assert film.n_frames == 4
    first = np.asarray(film.convert("RGB")).astype(int)
    film.seek(3)
    assert np.abs(np.asarray(film.convert("RGB")).astype(int) - first).max() > 60


def test_without_a_browser_the_package_is_named(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ViewError, match="apt-get install chromium"):
        write_picture(tmp_path / "no.png", page, 0.0)


def test_an_unknown_ending_is_refused(page: Path, tmp_path: Path) -> None:
    with pytest.raises(ViewError, match=r"ends in \.gif"):
        write_animation(tmp_path / "film.avi", page)
