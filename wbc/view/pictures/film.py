"""Pictures one after the other, as GIF or MP4."""

from __future__ import annotations

import importlib
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from PIL import Image

from wbc.errors import ViewError
from wbc.files import atomic_write

_PALETTE_FRAMES = 8


def write_gif(path: Path, pictures: Iterator[Image.Image], frame_rate: float) -> Path:
    """Write pictures as a GIF that repeats for ever."""
    films = list(pictures)
    # One palette for all frames: no flicker, and pixels that stay compress away. It is made from
    # frames all over the film, so that a colour that comes late is in it.
    sample = films[:: max(1, len(films) // _PALETTE_FRAMES)]
    width, height = films[0].size
    mosaic = Image.new("RGB", (width, height * len(sample)))
    for i, picture in enumerate(sample):
        mosaic.paste(picture, (0, i * height))
    palette = _palette(mosaic)
    frames = [film.quantize(palette=palette, dither=Image.Dither.NONE) for film in films]

    def write(file: BinaryIO) -> None:
        frames[0].save(
            file,
            format="GIF",
            save_all=True,
            append_images=frames[1:],
            duration=round(1000.0 / frame_rate),
            loop=0,
            optimize=False,
        )

    return atomic_write(path, write)


def _palette(picture: Image.Image) -> Image.Image:
    """Return 256 colours: most for the shades that fill a picture, some for small marks."""
    shades = picture.quantize(colors=200, method=Image.Quantize.MEDIANCUT).getpalette() or []
    marks = picture.quantize(colors=56, method=Image.Quantize.MAXCOVERAGE).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette(shades[:600] + marks[:168])
    return palette


def find_ffmpeg() -> str:
    """Return the path of an ffmpeg: the system's, or that of the package imageio-ffmpeg.

    Raises:
        ViewError: none is installed; the message names the packages.
    """
    found = shutil.which("ffmpeg")
    if found is not None:
        return found
    try:
        return str(importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise ViewError(
            "an MP4 needs ffmpeg, and none is on the PATH. On Debian: apt-get install ffmpeg; "
            "without root: pip install 'wbc[video]'. A .gif needs nothing more."
        ) from None


def write_mp4(path: Path, pictures: Iterator[Image.Image], frame_rate: float, ffmpeg: str) -> Path:
    """Write pictures as an MP4 (H.264) that browsers and presentations play.

    Raises:
        ViewError: ffmpeg fails; the message is its own.
    """
    with tempfile.TemporaryDirectory(prefix="wbc-view-") as folder:
        for i, picture in enumerate(pictures):
            picture.save(Path(folder) / f"{i:06d}.png")
        film = Path(folder) / "film.mp4"
        command = [ffmpeg, "-y", "-loglevel", "error", "-framerate", f"{frame_rate:g}"]
        command += ["-i", f"{folder}/%06d.png", "-pix_fmt", "yuv420p", "-crf", "20"]
        # The colour format halves both sides; the index in front lets a browser start at once.
        command += ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-movflags", "+faststart", str(film)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise ViewError(f"ffmpeg could not write '{path}': {done.stderr.strip()}")
        content = film.read_bytes()
    return atomic_write(path, lambda file: file.write(content))
