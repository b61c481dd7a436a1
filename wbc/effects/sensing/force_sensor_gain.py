"""A force sensor that reads too much or too little."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbc.robot import ContactForces, Effect, Parameter, Robot, Usual

# Force sensors that are mounted and wired as described are off by some per cent.
_USUAL = Usual(1.0, 1.0, 0.1, factor=True)


@final
@dataclass(frozen=True)
class ForceSensorGain(Effect):
    """The force sensor of a contact reports gain times the true force, on all axes.

    Attributes:
        gain: reported / true force.
    """

    gain: float

    name = "force_sensor_gain"
    parameters = (Parameter("gain", "1", 1.0, 0.2, 5.0, 0.05, usual=_USUAL),)
    explanation = (
        "The force sensor of a contact is calibrated wrongly: it reports the same share too much "
        "or too little of every force."
    )
    experiment = (
        "Weigh the robot on a scale while it stands on this contact alone: what the sensor "
        "reports is off by the gain. A known mass added to the robot changes the reported force "
        "by gain times its weight."
    )

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every contact."""
        return tuple(contact.name for contact in robot.contacts)

    def measured_forces(self, robot: Robot, forces: ContactForces) -> ContactForces:
        """Return the forces with this contact's multiplied by the gain."""
        return self._scaled(forces, self.gain)

    def true_forces(self, robot: Robot, forces: ContactForces) -> ContactForces:
        """Return the forces with this contact's divided by the gain."""
        return self._scaled(forces, 1.0 / self.gain)

    def _scaled(self, forces: ContactForces, factor: float) -> ContactForces:
        if self.where not in forces:
            return forces
        return {**forces, self.where: factor * forces[self.where]}
