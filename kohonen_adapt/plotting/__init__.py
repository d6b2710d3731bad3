"""Pictures of meshes, fields, densities, passes, outlines and the learning map (needs matplotlib)."""

from kohonen_adapt.plotting.adaptation import adaptation_figure
from kohonen_adapt.plotting.animation import animate_map, animate_passes
from kohonen_adapt.plotting.convergence import plot_convergence
from kohonen_adapt.plotting.densities import plot_density
from kohonen_adapt.plotting.drawing import draw_field_lines, draw_indicators, draw_mesh, indicator_scale
from kohonen_adapt.plotting.magnetisation import plot_bh
from kohonen_adapt.plotting.outlines import plot_outlines
from kohonen_adapt.plotting.passes import draw_passes
from kohonen_adapt.plotting.qualities import plot_qualities

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
]
