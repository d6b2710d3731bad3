"""Draw an adaptation on one page: meshes and indicators before and after, field lines, estimates."""

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import ArrayLike

from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.mesh.slicing import CutBy
from kohonen_adapt.plotting.charts import draw_passes
from kohonen_adapt.plotting.drawing import draw_field_lines, draw_indicators, draw_mesh, indicator_scale

__all__ = ["adaptation_figure"]


def adaptation_figure(
    before: AdaptResult,
    after: AdaptResult,
    *,
    potential: ArrayLike,
    magnitude: ArrayLike,
    magnitude_label: str,
    indicator_label: str = "error indicator of an element",
    lines_title: str = "Field lines",
    unit: str = "m",
    errors: Sequence[float] | None = None,
    plane: CutBy | None = None,
) -> Figure:
    """Mesh and indicators before and after, field lines, and the estimate over the passes, on one page.

    Of tetrahedra it is cuts.

    Parameters
    ----------
    before
        The input: the result of ``adapt(..., passes=0)``.
    after
        The adapted result.
    potential
        (nnodes,), nodal values on ``after.mesh``; their contours are the field lines.
    magnitude
        (nelements,), what is coloured under the field lines; either may be of a lattice, as of `draw_field_lines`.
    magnitude_label, indicator_label
        Labels of the colour bars, with units.
    lines_title
        What the contours are.
    unit
        Unit of the axes: "m" or "mm" for a mesh in metres, "" for one without a unit.
    errors
        The exact error of every pass, where it is known.
    plane
        Where meshes of tetrahedra are cut, a `kohonen_adapt.Plane`.

    Returns
    -------
    Figure
        To be saved by ``figure.savefig(path)``.

    Raises
    ------
    ValueError
        If an array has the wrong shape, the unit is unknown, or tetrahedra come without a plane that meets them.
    """
    figure = Figure(figsize=(13.0, 7.6), dpi=160, layout=ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.1))
    panels = figure.subplots(2, 3)
    norm = indicator_scale(before.indicators, after.indicators)
    for column, (word, result) in enumerate([("before", before), ("after", after)]):
        draw_mesh(panels[0, column], result.mesh, plane=plane, unit=unit)
        panels[0, column].set_title(f"Mesh {word}: {result.mesh.nvertices} nodes")
        shades = draw_indicators(panels[1, column], result.mesh, result.indicators, norm=norm, plane=plane, unit=unit)
        panels[1, column].set_title(f"Error indicators {word}")
    figure.colorbar(shades, ax=panels[1, 1], label=indicator_label, extend="min")
    colours = draw_field_lines(panels[0, 2], after.mesh, potential, magnitude, plane=plane, unit=unit)
    figure.colorbar(colours, ax=panels[0, 2], label=magnitude_label, extend="max")
    panels[0, 2].set_title(f"{lines_title} after")
    draw_passes(panels[1, 2], after.history, errors=errors)
    panels[1, 2].set_title("Estimate over the passes")
    return figure
