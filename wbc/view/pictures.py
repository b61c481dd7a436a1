"""Pictures and animations of a playback, taken in a browser without a display."""

from __future__ import annotations

import io
import shutil
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from wbc.errors import ViewError, needs
from wbc.files import atomic_write

if TYPE_CHECKING:
    from playwright.sync_api import Page

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
_FLAGS = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
    "--force-color-profile=srgb",
)
_PATIENCE = 60e3  # [ms]


@contextmanager
def opened(page: Path, size: tuple[int, int], fragment: str = "") -> Iterator[Page]:
    """Open a page in a Chromium without a display.

    Args:
        page: an HTML file.
        size: width and height of the window [px].
        fragment: what to put behind the # of the address.

    Raises:
        ViewError: no Chromium (the message names the package), or a page that fails.
        MissingPackageError: no playwright.
    """
    program = next(filter(None, map(shutil.which, _BROWSERS)), None)
    if program is None:
        raise ViewError(
            "pictures and animations need a Chromium browser, and none of "
            f"{', '.join(_BROWSERS)} is on the PATH. On Debian: apt-get install chromium "
            "(on Ubuntu: apt-get install chromium-browser). The HTML playback works without it."
        )
    with needs("pictures", "a picture of a page"):
        from playwright.sync_api import Error, sync_playwright
    with sync_playwright() as driver:
        try:
            browser = driver.chromium.launch(executable_path=program, args=_FLAGS)
            shown = browser.new_page(viewport={"width": size[0], "height": size[1]})
            shown.set_default_timeout(_PATIENCE)
            shown.goto(page.resolve().as_uri() + (f"#{fragment}" if fragment else ""))
            yield shown
            browser.close()
        except Error as cause:
            raise ViewError(f"the browser failed at '{page}': {cause.message}") from cause


def write_picture(
    path: str | Path, playback: str | Path, at: float, *, size: tuple[int, int] = (1280, 800)
) -> Path:
    """Write a PNG of a playback page at a time, in the theme of the page.

    Args:
        path: the PNG to write.
        playback: HTML written by `write_playback`.
        at: time [s] on the log's clock, clipped to the log.
        size: width and height [px].

    Raises:
        ViewError: no Chromium (the message names the package), or a page that is no playback.
    """

    (picture,) = _frames(playback, size, "still", lambda page: [at])
    return atomic_write(path, lambda file: file.write(picture))


def write_animation(
    path: str | Path,
    playback: str | Path,
    span: tuple[float | None, float | None] = (None, None),
    *,
    speed: float = 1.0,
    frame_rate: float = 15.0,
    size: tuple[int, int] = (640, 480),
) -> Path:
    """Write a GIF of a playback page, in the theme of the page.

    Args:
        path: ends in .gif.
        playback: HTML written by `write_playback`.
        span: from when to when [s] on the log's clock; None for an end of the log.
        speed: 0.5 shows it at half speed.
        frame_rate: frames per second of the animation.
        size: width and height [px].

    Raises:
        ViewError: no Chromium (the message names the package), another ending, or a span of time
            that is empty.
    """
    if Path(path).suffix.lower() != ".gif":
        raise ViewError(f"'{path}': an animation ends in .gif.")

    def instants(page: Page) -> list[float]:
        ends = [float(page.evaluate(f"player.{name}")) for name in ("start", "stop")]
        begin, end = (e if given is None else given for e, given in zip(ends, span, strict=True))
        if not (end > begin and speed > 0.0 and frame_rate > 0.0):
            raise ViewError(f"nothing to animate from {begin:g} s to {end:g} s at speed {speed:g}.")
        return [float(at) for at in np.arange(begin, end, speed / frame_rate)]

    taken = _frames(playback, size, "still&bare", instants)
    films = [Image.open(io.BytesIO(one)).convert("RGB") for one in taken]
    return write_gif(Path(path), films, frame_rate)


def _frames(
    playback: str | Path,
    size: tuple[int, int],
    fragment: str,
    instants: Callable[[Page], Sequence[float]],
) -> list[bytes]:
    """Return pictures (PNG) of a playback at some times [s].

    A thread of its own takes them: a notebook runs a loop in its thread, where playwright cannot.
    """

    def take() -> list[bytes]:
        with opened(Path(playback), size, fragment) as page:
            page.wait_for_function("window.player")
            page.evaluate("() => player.frameCamera()")
            taken = []
            for at in instants(page):
                page.evaluate(f"() => {{ player.seek({at!r}); player.picture(); }}")
                taken.append(page.screenshot())
            return taken

    with ThreadPoolExecutor(1) as thread:
        return thread.submit(take).result()


def write_gif(path: Path, films: Sequence[Image.Image], frame_rate: float) -> Path:
    """Write pictures as a GIF that repeats for ever."""
    # One palette for all frames: no flicker, and pixels that stay compress away. It is made from
    # frames all over the film, so that a colour that comes late is in it: most of it for the shades
    # that fill a picture, some for small marks.
    sample = [np.asarray(film) for film in films[:: max(1, len(films) // 8)]]
    mosaic, palette = Image.fromarray(np.concatenate(sample)), Image.new("P", (1, 1))
    shades = mosaic.quantize(200, Image.Quantize.MEDIANCUT).getpalette() or []
    marks = mosaic.quantize(56, Image.Quantize.MAXCOVERAGE).getpalette() or []
    palette.putpalette(shades[:600] + marks[:168])
    first, *others = (film.quantize(palette=palette, dither=Image.Dither.NONE) for film in films)
    more = {"save_all": True, "append_images": others, "loop": 0, "optimize": False}
    duration = round(1000.0 / frame_rate)
    return atomic_write(path, lambda file: first.save(file, "GIF", duration=duration, **more))
