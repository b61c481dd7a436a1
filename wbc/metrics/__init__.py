"""Inertia tensors, force capability and impact mitigation of a robot with lossy gears."""

from wbc.metrics.designs import (
    ContactTask as ContactTask,
    Designs as Designs,
    contact_task as contact_task,
    upward as upward,
    with_contact_at as with_contact_at,
)
from wbc.metrics.force_capability import (
    ForceCapability as ForceCapability,
    ForceRange as ForceRange,
    Holding as Holding,
    force_capability as force_capability,
    holding as holding,
)
from wbc.metrics.inertia import (
    DirectionalInertia as DirectionalInertia,
    ImpactMitigation as ImpactMitigation,
    backward_generalized_inertia as backward_generalized_inertia,
    directional_inertia as directional_inertia,
    forward_generalized_inertia as forward_generalized_inertia,
    generalized_inertia as generalized_inertia,
    impact_mitigation as impact_mitigation,
)
from wbc.metrics.summary import (
    DesignMetrics as DesignMetrics,
    Metric as Metric,
    design_metrics as design_metrics,
    summary as summary,
)
