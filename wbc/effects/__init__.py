"""One small final class per physical effect, shared by controller, simulator and logs."""

from wbc.effects.catalogue import EFFECTS as EFFECTS, effect_class as effect_class
from wbc.effects.drive import (
    ActuationDelay as ActuationDelay,
    CurrentLimit as CurrentLimit,
    RotorInertia as RotorInertia,
    SupplySag as SupplySag,
    ThermalDrift as ThermalDrift,
    TorqueConstant as TorqueConstant,
    TorqueOffset as TorqueOffset,
    VoltageScaling as VoltageScaling,
)
from wbc.effects.formula import CustomTorque as CustomTorque, TorqueTerm as TorqueTerm
from wbc.effects.friction import (
    CoulombFriction as CoulombFriction,
    DirectionalViscousFriction as DirectionalViscousFriction,
    QuadraticDrag as QuadraticDrag,
    StribeckFriction as StribeckFriction,
    ThermalViscousFriction as ThermalViscousFriction,
    ViscousFriction as ViscousFriction,
)
from wbc.effects.gear_losses import (
    Backlash as Backlash,
    JointCompliance as JointCompliance,
    LoadFriction as LoadFriction,
    LoadStribeckFriction as LoadStribeckFriction,
    TransmissionEfficiency as TransmissionEfficiency,
)
from wbc.effects.joint_effect import JointEffect as JointEffect
from wbc.effects.links import (
    CenterOfMass as CenterOfMass,
    GravityDirection as GravityDirection,
    LinkInertia as LinkInertia,
    LinkInertias as LinkInertias,
    PayloadMass as PayloadMass,
)
from wbc.effects.position_torques import JointSpring as JointSpring, TorqueRipple as TorqueRipple
from wbc.effects.presliding import LoadPresliding as LoadPresliding, Presliding as Presliding
from wbc.effects.saved import load_robot as load_robot, save_robot as save_robot
from wbc.effects.sensing import (
    ContactRadius as ContactRadius,
    ForceSensorGain as ForceSensorGain,
    PositionOffset as PositionOffset,
)
