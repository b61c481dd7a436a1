"""A meshcat window without a server: it keeps the commands, to be put into a page."""

from __future__ import annotations

import base64
from typing import Any

import umsgpack
from meshcat import Visualizer


class CommandRecorder:
    """Stands where meshcat's `ViewerWindow` stands; nothing is opened, nothing is served."""

    def __init__(self) -> None:
        """Start with an empty scene."""
        self._commands: list[bytes] = []

    def send(self, command: Any) -> None:
        """Keep one meshcat command."""
        self._commands.append(umsgpack.packb(command.lower()))

    def visualizer(self) -> Visualizer:
        """Return a meshcat visualizer that draws into this recorder."""
        return Visualizer(window=self)

    def encoded(self) -> list[str]:
        """Return the commands, each as the base64 text of its message."""
        return [base64.b64encode(command).decode("ascii") for command in self._commands]
