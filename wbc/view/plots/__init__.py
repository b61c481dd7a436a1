"""Plots for print and screen; every function returns a matplotlib figure."""

from wbc.extras import needs

with needs("view", "drawing plots"):
    from wbc.view.plots.design import design_map, pareto_figure
    from wbc.view.plots.energy import LogEnergy, energy_audit, energy_figure
    from wbc.view.plots.impact import impact_figure
    from wbc.view.plots.leg import leg_figure
    from wbc.view.plots.power import power_figure
    from wbc.view.plots.residuals import residual_figure, staircase_figure, unexplained_figure
    from wbc.view.plots.standing import standing_figure
    from wbc.view.plots.style import DASHES, drawing, new_figure, write_figure
    from wbc.view.plots.tradeoff import tradeoff_figure
    from wbc.view.plots.trend import trend_figure

__all__ = [
    "DASHES",
    "LogEnergy",
    "design_map",
    "drawing",
    "energy_audit",
    "energy_figure",
    "impact_figure",
    "leg_figure",
    "new_figure",
    "pareto_figure",
    "power_figure",
    "residual_figure",
    "staircase_figure",
    "standing_figure",
    "tradeoff_figure",
    "trend_figure",
    "unexplained_figure",
    "write_figure",
]
