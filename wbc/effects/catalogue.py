"""The effects by their names."""

from __future__ import annotations

from types import MappingProxyType

from wbc.effects import (
    drive,
    formula,
    friction,
    gear_losses,
    links,
    position_torques,
    presliding,
    sensing,
)
from wbc.errors import EffectError, require_known
from wbc.robot import Effect

_CLASSES: tuple[type[Effect], ...] = (
    friction.ViscousFriction,
    friction.DirectionalViscousFriction,
    friction.ThermalViscousFriction,
    friction.CoulombFriction,
    friction.RotorViscousFriction,
    friction.RotorCoulombFriction,
    friction.StribeckFriction,
    presliding.Presliding,
    gear_losses.TransmissionEfficiency,
    presliding.LoadPresliding,
    gear_losses.LoadFriction,
    gear_losses.LoadStribeckFriction,
    friction.QuadraticDrag,
    drive.RotorInertia,
    links.PayloadMass,
    links.LinkInertia,
    links.LinkInertias,
    position_torques.JointSpring,
    drive.TorqueConstant,
    drive.TorqueOffset,
    position_torques.TorqueRipple,
    links.CenterOfMass,
    sensing.PositionOffset,
    sensing.ForceSensorGain,
    links.GravityDirection,
    links.ContactRadius,
    drive.ActuationDelay,
    drive.ThermalDrift,
    drive.SupplySag,
    drive.VoltageScaling,
    drive.CurrentLimit,
    gear_losses.JointCompliance,
    gear_losses.Backlash,
)

EFFECTS = MappingProxyType({cls.name: cls for cls in _CLASSES})
"""Every effect class by the name that logs, files and reports use."""


def effect_class(name: str) -> type[Effect]:
    """Return the effect class called `name`.

    Raises:
        EffectError: no such effect; the message lists those there are.
    """
    # A formula is no cause that a diagnosis could consider, but files and robots hold it.
    known: dict[str, type[Effect]] = {**EFFECTS, formula.CustomTorque.name: formula.CustomTorque}
    require_known(EffectError, "effect", name, known)
    return known[name]
