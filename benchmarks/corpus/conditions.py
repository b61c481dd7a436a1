"""How warm the motors are and how full the battery is in a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.corpus.excitation import Excitation
from benchmarks.corpus.machine import Machine

NOMINAL = 24.0  # [V]
_COLD, _WARM = 15.0, 60.0  # [deg C] between which runs begin
_RISE = 15.0  # [K] at most in a run: small motors with their brakes on
_EMPTY, _FULL = 0.75, 1.08  # of the nominal voltage, between which runs begin
_FALL = 0.06  # of the nominal voltage at most in a run


@dataclass(frozen=True, eq=False)
class Conditions:
    """The conditions of one run.

    Attributes:
        temperature: (N, m) of the motors [deg C].
        voltage: (N,) of the supply [V].
    """

    temperature: np.ndarray
    voltage: np.ndarray

    def thinned(self, every: int) -> Conditions:
        """Return every so many-th sample."""
        return Conditions(self.temperature[::every], self.voltage[::every])


def conditions_of(machine: Machine, excitation: Excitation, time: np.ndarray) -> Conditions:
    """Return the conditions of a run; a run that repeats another has those of the other."""
    random = np.random.default_rng([9, excitation.seed])
    m, duration = len(machine.driven), excitation.duration
    begins = random.uniform(_COLD, _WARM) + random.uniform(-5.0, 5.0, m)
    rise = random.uniform(0.0, _RISE, m)
    # Half of the rise comes in the first third of the run.
    warmer = 1.0 - np.exp(-2.0 * time / duration)
    full, fall = random.uniform(_EMPTY, _FULL), random.uniform(0.0, _FALL)
    voltage = NOMINAL * (full - fall * time / duration)
    return Conditions(begins + rise * warmer[:, None], voltage)
