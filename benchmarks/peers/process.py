"""A peer in its own process, asked for blocks of ticks."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path


class Peer:
    """Starts a peer script with the Python that an environment variable names.

    Attributes:
        name: what the tables call it.
        version: of the peer and its libraries.
    """

    def __init__(self, name: str, variable: str, script: Path, scene: Path) -> None:
        """Start the peer and wait until it is ready.

        Raises:
            LookupError: the variable is not set; the message says what to do.
            RuntimeError: the peer cannot run the scene.
        """
        python = os.environ.get(variable)
        if python is None:
            raise LookupError(f"{name} is absent: set {variable} to a Python that has it.")
        self.name = name
        environment = os.environ | {"OMP_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [python, str(script), str(scene)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
        )
        self.version = str(self._answer()[0])

    def run(self, first: int, count: int) -> list[list[float]]:
        """Return processor and wall time [us] of `count` ticks from `first`."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{first} {count}\n")
        self._process.stdin.flush()
        return list(self._answer())

    def close(self) -> None:
        """Stop the peer."""
        self._process.kill()
        self._process.wait()

    def _answer(self):
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line.strip():
            self._process.kill()
            _, error = self._process.communicate()
            raise RuntimeError(f"{self.name} stopped: {error.strip().splitlines()[-1:]}")
        return json.loads(line)
