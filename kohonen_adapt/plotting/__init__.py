"""Pictures of meshes, fields, passes and outlines (needs matplotlib)."""

from .adaptation import (
    adaptation_figure,
    draw_field_lines,
    draw_indicators,
    draw_mesh,
    draw_passes,
    indicator_scale,
)
from .magnetisation import plot_bh
from .outlines import plot_outlines

__all__ = [
    "adaptation_figure",
    "draw_field_lines",
    "draw_indicators",
    "draw_mesh",
    "draw_passes",
    "indicator_scale",
    "plot_bh",
    "plot_outlines",
]
