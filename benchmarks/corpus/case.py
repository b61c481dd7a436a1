"""A case: a robot, what is hidden in it, how it was recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.corpus.excitation import Excitation
from benchmarks.corpus.flaws import Flaw
from benchmarks.corpus.machine import Machine
from benchmarks.corpus.sensors import Sensors
from benchmarks.corpus.unlisted import NAMES as UNLISTED


@dataclass(frozen=True, eq=False)
class Case:
    """One case of the corpus.

    Attributes:
        number: in the corpus.
        machine: as the user believes it to be.
        flaws: what is wrong with it.
        excitations: the runs.
        richness: `poor`, `fair`, `good` or `rich`.
        sensors: how they were recorded.
        torque_noise: (m,) rms at the motor outputs [N m].
    """

    number: int
    machine: Machine
    flaws: tuple[Flaw, ...]
    excitations: tuple[Excitation, ...]
    richness: str
    sensors: Sensors
    torque_noise: np.ndarray

    @property
    def unlisted(self) -> bool:
        """Whether a cause is outside the library's list."""
        return any(flaw.effect in UNLISTED for flaw in self.flaws)

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of what is hidden, in the order drawn."""
        return tuple(dict.fromkeys(flaw.effect for flaw in self.flaws))

    @property
    def label(self) -> str:
        """What is hidden where."""
        return " + ".join(f"{f.effect}@{f.where}" for f in self.flaws) or "nothing"
