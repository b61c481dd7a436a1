"""A page in a browser without a display."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from wbc.errors import ViewError
from wbc.extras import needs

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
def opened(page: Path, width: int, height: int, fragment: str = "") -> Iterator[Page]:
    """Open a page in a Chromium without a display.

    Args:
        page: an HTML file.
        width, height: size of the window [px].
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
            shown = browser.new_page(viewport={"width": width, "height": height})
            shown.set_default_timeout(_PATIENCE)
            shown.goto(page.resolve().as_uri() + (f"#{fragment}" if fragment else ""))
            yield shown
            browser.close()
        except Error as cause:
            raise ViewError(f"the browser failed at '{page}': {cause.message}") from cause
