"""The metrics of many designs of one robot at once, in arrays."""

from wbc.metrics.batch.design_metrics import DesignMetrics, design_metrics, held_torques
from wbc.metrics.batch.designs import Designs, link_length

__all__ = ["DesignMetrics", "Designs", "design_metrics", "held_torques", "link_length"]
