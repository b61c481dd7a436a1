"""The effects by their names."""

from __future__ import annotations

from types import MappingProxyType

from wbc.effects.drive.actuation_delay import ActuationDelay
from wbc.effects.drive.current_limit import CurrentLimit
from wbc.effects.drive.rotor_inertia import RotorInertia
from wbc.effects.drive.supply_sag import SupplySag
from wbc.effects.drive.thermal_drift import ThermalDrift
from wbc.effects.drive.torque_constant import TorqueConstant
from wbc.effects.drive.torque_offset import TorqueOffset
from wbc.effects.drive.torque_ripple import TorqueRipple
from wbc.effects.drive.voltage_scaling import VoltageScaling
from wbc.effects.formula.custom_torque import CustomTorque
from wbc.effects.friction.coulomb_friction import CoulombFriction
from wbc.effects.friction.directional_viscous_friction import DirectionalViscousFriction
from wbc.effects.friction.load_friction import LoadFriction
from wbc.effects.friction.load_stribeck_friction import LoadStribeckFriction
from wbc.effects.friction.quadratic_drag import QuadraticDrag
from wbc.effects.friction.rotor_coulomb_friction import RotorCoulombFriction
from wbc.effects.friction.rotor_viscous_friction import RotorViscousFriction
from wbc.effects.friction.stribeck_friction import StribeckFriction
from wbc.effects.friction.thermal_viscous_friction import ThermalViscousFriction
from wbc.effects.friction.viscous_friction import ViscousFriction
from wbc.effects.gear.backlash import Backlash
from wbc.effects.gear.joint_compliance import JointCompliance
from wbc.effects.gear.transmission_efficiency import TransmissionEfficiency
from wbc.effects.links.center_of_mass import CenterOfMass
from wbc.effects.links.gravity_direction import GravityDirection
from wbc.effects.links.joint_spring import JointSpring
from wbc.effects.links.link_inertia import LinkInertia
from wbc.effects.links.link_inertias import LinkInertias
from wbc.effects.links.payload_mass import PayloadMass
from wbc.effects.presliding.load_presliding import LoadPresliding
from wbc.effects.presliding.presliding import Presliding
from wbc.effects.sensing.force_sensor_gain import ForceSensorGain
from wbc.effects.sensing.position_offset import PositionOffset
from wbc.errors import EffectError, unknown_name
from wbc.robot import Effect

_CLASSES: tuple[type[Effect], ...] = (
    ViscousFriction,
    DirectionalViscousFriction,
    ThermalViscousFriction,
    CoulombFriction,
    RotorViscousFriction,
    RotorCoulombFriction,
    StribeckFriction,
    Presliding,
    TransmissionEfficiency,
    LoadPresliding,
    LoadFriction,
    LoadStribeckFriction,
    QuadraticDrag,
    RotorInertia,
    PayloadMass,
    LinkInertia,
    LinkInertias,
    JointSpring,
    TorqueConstant,
    TorqueOffset,
    TorqueRipple,
    CenterOfMass,
    PositionOffset,
    ForceSensorGain,
    GravityDirection,
    ActuationDelay,
    ThermalDrift,
    SupplySag,
    VoltageScaling,
    CurrentLimit,
    JointCompliance,
    Backlash,
)

EFFECTS = MappingProxyType({cls.name: cls for cls in _CLASSES})
"""Every effect class by the name that logs, files and reports use."""


def effect_class(name: str) -> type[Effect]:
    """Return the effect class called `name`.

    Raises:
        EffectError: no such effect; the message lists those there are.
    """
    # A formula is no cause that a diagnosis could consider, but files and robots hold it.
    known: dict[str, type[Effect]] = {**EFFECTS, CustomTorque.name: CustomTorque}
    if name not in known:
        raise EffectError(unknown_name("effect", name, known))
    return known[name]
