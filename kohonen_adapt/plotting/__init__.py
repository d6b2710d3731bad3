"""Pictures of meshes, fields, passes and sweeps (needs matplotlib)."""

from kohonen_adapt.plotting.animation import animate_map, animate_passes
from kohonen_adapt.plotting.charts import draw_passes, plot_bh, plot_convergence, plot_density, plot_qualities
from kohonen_adapt.plotting.drawing import draw_field_lines, draw_indicators, draw_mesh, indicator_scale
from kohonen_adapt.plotting.figures import adaptation_figure, sweep_figure
from kohonen_adapt.plotting.outlines import plot_outlines
from kohonen_adapt.plotting.solids import plot_slice, plot_surface

__all__ = [
    "adaptation_figure",
    "animate_map",
    "animate_passes",
    "draw_field_lines",
    "draw_indicators",
    "draw_mesh",
    "draw_passes",
    "indicator_scale",
    "plot_bh",
    "plot_convergence",
    "plot_density",
    "plot_outlines",
    "plot_qualities",
    "plot_slice",
    "plot_surface",
    "sweep_figure",
]
