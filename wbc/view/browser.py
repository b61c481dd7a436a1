"""A browser without a display: enough of Chromium's DevTools protocol to take pictures."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self, final

from wbc.errors import ViewError

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
_FLAGS = (
    "--headless",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--mute-audio",
    "--no-first-run",
    "--force-color-profile=srgb",
    "--remote-debugging-pipe",
)
_PATIENCE = 60.0
# Chromium listens on descriptor 3 and answers on 4. The pipes are put there in a process of its
# own: this one may have other threads and other uses for 3 and 4.
_LAUNCH = """
import fcntl, os, sys
high = [fcntl.fcntl(int(fd), fcntl.F_DUPFD, 10) for fd in sys.argv[1:3]]
os.dup2(high[0], 3)
os.dup2(high[1], 4)
os.execv(sys.argv[3], sys.argv[3:])
"""


def find_browser() -> str:
    """Return the path of a Chromium.

    Raises:
        ViewError: none is installed; the message names the package.
    """
    for name in _NAMES:
        found = shutil.which(name)
        if found is not None:
            return found
    raise ViewError(
        "pictures and animations need a Chromium browser, and none of "
        f"{', '.join(_NAMES)} is on the PATH. On Debian: apt-get install chromium "
        "(on Ubuntu: apt-get install chromium-browser). The HTML playback works without it."
    )


@final
class HeadlessBrowser:
    """One page in a headless Chromium; use it in a `with` statement."""

    def __init__(self, page: Path, width: int, height: int, fragment: str = "") -> None:
        """Remember what to open.

        Args:
            page: an HTML file.
            width, height: size of the window [px].
            fragment: what to put behind the # of the address.
        """
        self._address = page.resolve().as_uri() + (f"#{fragment}" if fragment else "")
        self._size = (width, height)
        self._number = 0
        self._buffer = b""
        self._session: str | None = None
        self._profile = tempfile.TemporaryDirectory(prefix="wbc-view-", ignore_cleanup_errors=True)

    def __enter__(self) -> Self:
        """Start the browser and load the page.

        Raises:
            ViewError: no browser, or one that does not start.
        """
        browser = find_browser()
        read_here, write_there = os.pipe()
        read_there, write_here = os.pipe()
        command = [
            browser,
            *_FLAGS,
            f"--user-data-dir={self._profile.name}",
            f"--window-size={self._size[0]},{self._size[1]}",
            "about:blank",
        ]
        self._process = subprocess.Popen(
            [
                sys.executable,
                "-I",
                "-S",
                "-c",
                _LAUNCH,
                str(read_there),
                str(write_there),
                *command,
            ],
            pass_fds=(read_there, write_there),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(read_there)
        os.close(write_there)
        self._read, self._write = read_here, write_here
        try:
            self._open_page()
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop the browser."""
        self._close()

    def evaluate(self, expression: str) -> Any:
        """Return the value of a JavaScript expression (a promise is awaited).

        Raises:
            ViewError: the page throws.
        """
        answer = self._call(
            "Runtime.evaluate",
            {"expression": expression, "returnByValue": True, "awaitPromise": True},
        )
        if "exceptionDetails" in answer:
            detail = answer["exceptionDetails"]
            text = detail.get("exception", {}).get("description", detail.get("text"))
            raise ViewError(f"the page failed at '{expression}': {text}.")
        return answer["result"].get("value")

    def wait_for(self, expression: str) -> None:
        """Wait until a JavaScript expression is true.

        Raises:
            ViewError: it is not within a minute.
        """
        limit = time.monotonic() + _PATIENCE
        while not self.evaluate(f"Boolean({expression})"):
            if time.monotonic() > limit:
                raise ViewError(f"the page did not get ready: '{expression}' stays false.")
            time.sleep(0.05)

    def screenshot(self) -> bytes:
        """Return what the page shows as PNG."""
        answer = self._call("Page.captureScreenshot", {"format": "png"})
        return base64.b64decode(answer["data"])

    def _open_page(self) -> None:
        target = self._call("Target.createTarget", {"url": "about:blank"})
        attached = self._call(
            "Target.attachToTarget", {"targetId": target["targetId"], "flatten": True}
        )
        self._session = attached["sessionId"]
        width, height = self._size
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._call("Emulation.setDeviceMetricsOverride", metrics)
        self._call("Page.navigate", {"url": self._address})
        self.wait_for("document.readyState === 'complete' && location.href !== 'about:blank'")

    def _call(self, method: str, parameters: dict[str, Any]) -> dict[str, Any]:
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        try:
            os.write(self._write, json.dumps(message).encode() + b"\0")
        except BrokenPipeError as cause:
            raise ViewError("the browser stopped; does it start from a terminal?") from cause
        while True:
            answer = self._receive()
            if answer.get("id") != self._number:
                continue
            if "error" in answer:
                raise ViewError(f"the browser refused {method}: {answer['error']['message']}.")
            result: dict[str, Any] = answer["result"]
            return result

    def _receive(self) -> dict[str, Any]:
        limit = time.monotonic() + _PATIENCE
        while b"\0" not in self._buffer:
            ready = select.select([self._read], [], [], max(0.0, limit - time.monotonic()))[0]
            chunk = os.read(self._read, 1 << 20) if ready else b""
            if not chunk:
                raise ViewError("the browser does not answer; does it start from a terminal?")
            self._buffer += chunk
        text, self._buffer = self._buffer.split(b"\0", 1)
        answer: dict[str, Any] = json.loads(text)
        return answer

    def _close(self) -> None:
        for descriptor in (self._write, self._read):
            os.close(descriptor)
        # Losing its pipe ends Chromium; a stubborn one is killed.
        try:
            self._process.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._profile.cleanup()
