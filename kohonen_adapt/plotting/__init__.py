"""Pictures of meshes, fields, densities, passes, outlines and the learning map (needs matplotlib)."""

from .adaptation import adaptation_figure
from .animation import animate_map, animate_passes
from .convergence import plot_convergence
from .densities import plot_density
from .drawing import draw_field_lines, draw_indicators, draw_mesh, indicator_scale
from .magnetisation import plot_bh
from .outlines import plot_outlines
from .passes import draw_passes
from .qualities import plot_qualities

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
