"""Figures of an adaptation and of the outputs of a sweep."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import ArrayLike

from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.mesh.slicing import CutBy
from kohonen_adapt.plotting.charts import draw_passes
from kohonen_adapt.plotting.drawing import draw_field_lines, draw_indicators, draw_mesh, indicator_scale
from kohonen_adapt.sweeps.cases import ASKED, ERROR, SweepResult, shown

__all__ = ["adaptation_figure", "sweep_figure"]

COLUMNS = 3  # of panels
NAMED = 10  # maximum number of curves in a legend


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
    axisymmetric: bool = False,
) -> Figure:
    """Draw an adaptation on one page.

    The panels show mesh and indicators before and after, field lines, and the estimate over the passes. Meshes of
    tetrahedra are drawn as cuts.

    Parameters
    ----------
    before
        The result for the input mesh, from ``adapt(..., passes=0)``.
    after
        The adapted result.
    potential
        Nodal values (nnodes,) on ``after.mesh``, whose contours are the field lines. At higher order, values at the
        points of a lattice, as in `draw_field_lines`.
    magnitude
        Values (nelements,) for the colours under the field lines, or values at the points of a lattice.
    magnitude_label, indicator_label
        Labels of the colour bars, with units.
    lines_title
        Name of the contours.
    unit
        Unit of the axes: "m" or "mm" for a mesh in metres, "" for a mesh without a unit.
    errors
        The exact error of every pass, if known.
    plane
        Cutting plane for a mesh of tetrahedra, a `kohonen_adapt.Plane`.
    axisymmetric
        As in `draw_mesh`.

    Returns
    -------
    Figure
        Save with ``figure.savefig(path)``.

    Raises
    ------
    ValueError
        If an array has the wrong shape, if the unit is unknown, or if no plane that cuts the mesh is given for
        tetrahedra.
    """
    figure = Figure(figsize=(13.0, 7.6), dpi=160, layout=ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.1))
    panels = figure.subplots(2, 3)
    view: Any = {"plane": plane, "unit": unit, "axisymmetric": axisymmetric}
    norm = indicator_scale(before.indicators, after.indicators)
    for column, (word, result) in enumerate([("before", before), ("after", after)]):
        draw_mesh(panels[0, column], result.mesh, **view)
        panels[0, column].set_title(f"Mesh {word}: {result.mesh.nvertices} nodes")
        shades = draw_indicators(panels[1, column], result.mesh, result.indicators, norm=norm, **view)
        panels[1, column].set_title(f"Error indicators {word}")
    figure.colorbar(shades, ax=panels[1, 1], label=indicator_label, extend="min")
    colours = draw_field_lines(panels[0, 2], after.mesh, potential, magnitude, **view)
    figure.colorbar(colours, ax=panels[0, 2], label=magnitude_label, extend="max")
    panels[0, 2].set_title(f"{lines_title} after")
    draw_passes(panels[1, 2], after.history, errors=errors)
    panels[1, 2].set_title("Estimate over the passes")
    return figure


def sweep_figure(result: SweepResult) -> Figure:
    """Draw every output of a sweep over the first parameter.

    Each output has a panel of its own, with one curve for every combination of the remaining parameters. Outputs that
    are texts have none, and an output "error of NAME" is drawn as error bars of the output NAME.

    Parameters
    ----------
    result
        The result of `kohonen_adapt.sweep`. Cases without an output leave a gap.

    Returns
    -------
    matplotlib.figure.Figure
        Save with ``figure.savefig(path)``.

    Raises
    ------
    ValueError
        If the result has no outputs, for instance because every case failed.
    """
    of_errors = {f"{prefix}{name}" for name in result.outputs for prefix in (ERROR, ASKED)}
    outputs = [name for name in result.outputs if name not in of_errors and result.table[name].dtype != object]
    if not outputs:
        raise ValueError("a sweep must have outputs to be drawn; every case of this one ended with an error.")
    columns = min(COLUMNS, len(outputs))
    rows = -(-len(outputs) // columns)
    figure = Figure(figsize=(5.5 * columns, 4.5 * rows), dpi=100, layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    first, curves = result.parameters[0], _curves(result)
    colours = colormaps["viridis"](np.linspace(0.0, 0.9, len(curves)))
    named = set(np.linspace(0, len(curves) - 1, min(NAMED, len(curves))).round().astype(int).tolist())
    for axes, output in zip(panels, outputs, strict=False):
        for number, ((label, cases), colour) in enumerate(zip(curves.items(), colours, strict=True)):
            x, y, error = result.table[first][cases], result.table[output][cases], f"{ERROR}{output}"
            axes.plot(x, y, "o-", color=colour, label=label if number in named else None, markersize=4)
            if error in result.outputs:
                axes.errorbar(x, y, np.abs(result.table[error][cases]), fmt="none", ecolor=colour, capsize=3)
        axes.set(xlabel=first, ylabel=output)
        axes.grid(alpha=0.3)
        if len(curves) > 1:
            axes.legend(fontsize="small")
    for axes in panels[len(outputs) :]:
        axes.remove()
    return figure


def _curves(result: SweepResult) -> dict[str, list[int]]:
    first, *others = result.parameters
    found: dict[str, list[int]] = {}
    values = result.table[first]
    order = np.argsort(values, kind="stable").tolist() if values.dtype.kind in "bif" else range(values.size)
    for number in order:
        shared = [f"{name} = {shown(result.table[name][number])}" for name in others]
        found.setdefault(", ".join(shared), []).append(number)
    return found
