"""Inertia tensors, force capability and impact mitigation of a robot with lossy gears."""

from wbc.metrics.contact_task import ContactTask, contact_task, upward, with_contact_at
from wbc.metrics.design_metrics import DesignMetrics, design_metrics
from wbc.metrics.designs import Designs
from wbc.metrics.force_capability import (
    ForceCapability,
    ForceRange,
    Holding,
    force_capability,
    holding,
)
from wbc.metrics.inertia import (
    DirectionalInertia,
    ImpactMitigation,
    backward_generalized_inertia,
    directional_inertia,
    forward_generalized_inertia,
    generalized_inertia,
    impact_mitigation,
    share_of_accelerations_forward,
)
from wbc.metrics.summary import Metric, summary

__all__ = [
    "ContactTask",
    "DesignMetrics",
    "Designs",
    "DirectionalInertia",
    "ForceCapability",
    "ForceRange",
    "Holding",
    "ImpactMitigation",
    "Metric",
    "backward_generalized_inertia",
    "contact_task",
    "design_metrics",
    "directional_inertia",
    "force_capability",
    "forward_generalized_inertia",
    "generalized_inertia",
    "holding",
    "impact_mitigation",
    "share_of_accelerations_forward",
    "summary",
    "upward",
    "with_contact_at",
]
