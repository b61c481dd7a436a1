"""Plots for print and screen; every function returns a matplotlib figure."""

from wbc.errors import needs

with needs("view", "drawing plots"):
    from wbc.view.leg_figures import leg_figure
    from wbc.view.run_figures import energy_audit, energy_figure, power_figure, standing_figure
    from wbc.view.study_figures import design_map, pareto_figure, trend_figure
    from wbc.view.style import DASHES, drawing, new_figure, panel_figure, write_figure

__all__ = [
    "DASHES",
    "design_map",
    "drawing",
    "energy_audit",
    "energy_figure",
    "leg_figure",
    "new_figure",
    "panel_figure",
    "pareto_figure",
    "power_figure",
    "standing_figure",
    "trend_figure",
    "write_figure",
]
