"""Inertia tensors, force capability and impact mitigation of a robot with lossy gears."""

from wbc.metrics.contact_task import ContactTask, contact_task
from wbc.metrics.force_capability import ForceCapability, ForceRange, force_capability
from wbc.metrics.impact_mitigation import ImpactMitigation, impact_mitigation
from wbc.metrics.inertia_ellipsoid import InertiaEllipsoid, inertia_ellipsoid
from wbc.metrics.inertia_tensor import (
    backward_generalized_inertia,
    forward_generalized_inertia,
    generalized_inertia,
)
from wbc.metrics.sweep import Sweep, efficiency_sweep, gear_ratio_sweep, pose_sweep

__all__ = [
    "ContactTask",
    "ForceCapability",
    "ForceRange",
    "ImpactMitigation",
    "InertiaEllipsoid",
    "Sweep",
    "backward_generalized_inertia",
    "contact_task",
    "efficiency_sweep",
    "force_capability",
    "forward_generalized_inertia",
    "gear_ratio_sweep",
    "generalized_inertia",
    "impact_mitigation",
    "inertia_ellipsoid",
    "pose_sweep",
]
