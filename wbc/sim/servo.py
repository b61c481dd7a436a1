"""A position servo on a DC motor: its drive, and what it was told during one run."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import LogError, RobotError
from wbc.measurement import Log, Machine


@dataclass(frozen=True)
class DcDrive:
    """What feeds the winding of a servo's motor; torque constant and resistance are the gear's.

    The position loop sets the share of the supply voltage on the winding, duty = clip(gain
    (goal - position)). While the switch is closed the supply and its wires carry the current of
    the winding, so that on average

        duty (supply_voltage - source_resistance |i|) = resistance i + torque_constant * speed

    (no capacitor that could hold the voltage over a switching period). The heat of the current
    raises the winding's resistance to resistance (1 + rise),

        d rise / dt = heating resistance (1 + rise) i^2 - cooling rise.

    Sag, current limit and warm winding are the three ways in which a drive gives less than its
    duty says.

    Attributes:
        supply_voltage: without load [V].
        source_resistance: of supply, wires and bridge while the switch is closed [ohm]; 0 is no
            sag.
        current_limit: largest current through the winding [A].
        duty_limit: largest duty, at most 1.
        heating: rise of the resistance, as a share of itself, per heat in the winding [1/J].
        cooling: rate at which the winding loses its rise [1/s].
    """

    supply_voltage: float
    source_resistance: float = 0.0
    current_limit: float = inf
    duty_limit: float = 1.0
    heating: float = 0.0
    cooling: float = 0.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name, good in (
            ("supply_voltage", self.supply_voltage > 0.0),
            ("source_resistance", self.source_resistance >= 0.0),
            ("current_limit", self.current_limit > 0.0),
            ("duty_limit", 0.0 < self.duty_limit <= 1.0),
            ("heating", self.heating >= 0.0),
            ("cooling", self.cooling >= 0.0),
        ):
            if not good:
                raise RobotError(f"DC drive: {name} = {getattr(self, name)} is out of range.")


def winding_current(
    duty: FloatArray,
    back_emf: FloatArray,
    resistance: FloatArray | float,
    supply_voltage: float,
    source_resistance: float,
    current_limit: float,
) -> FloatArray:
    """Return (duty V - e) / (R + R_s |duty|), clipped to the limit [A]; arrays broadcast.

    The law of `DcDrive`.
    """
    wanted = (duty * supply_voltage - back_emf) / (resistance + source_resistance * np.abs(duty))
    return np.minimum(np.maximum(wanted, -current_limit), current_limit)


@dataclass(frozen=True, eq=False)
class ServoRun:
    """Set point, power state and measured position of one joint.

    Attributes:
        name: of the log.
        gain: of the position loop in this run, duty per rad of error [1/rad].
        goal: (T,) set point [rad or m].
        enabled: (T,) 1 while powered, 0 while the winding is open.
        position: (T,) measured [rad or m]; its first value starts a simulation, at rest.
        machine: how drive and load of this run differ from the robot, None if in nothing.
    """

    name: str
    gain: float
    goal: FloatArray
    enabled: FloatArray
    position: FloatArray
    machine: Machine | None = None

    @classmethod
    def from_log(cls, log: Log, joint: str, gain: float, step: float) -> ServoRun:
        """Return the run of a log with position, target_position and, if there is one, enabled.

        Args:
            log: the log.
            joint: name of the driven joint.
            gain: of the position loop, duty per rad.
            step: time step of the even clock [s].

        Raises:
            LogError: a channel is missing.
        """
        for quantity in ("position", "target_position"):
            if not log.has(f"{joint}.{quantity}"):
                raise LogError(
                    f"{log.source.label}: the column '{joint}.{quantity}' is missing; a servo's "
                    "rollout needs position and set point."
                )
        time = np.arange(log.time[0], log.time[-1], step)
        last = np.searchsorted(log.time, time, side="right") - 1
        enabled = log.columns.get(f"{joint}.enabled", np.ones(len(log)))
        return cls(
            name=log.source.part or log.source.label,
            gain=gain,
            goal=np.interp(time, log.time, log.column(f"{joint}.target_position")),
            enabled=np.asarray(enabled[last]),
            position=np.interp(time, log.time, log.columns[f"{joint}.position"]),
            machine=log.machine,
        )
