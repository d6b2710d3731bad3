"""Pictures of an adaptation: meshes, indicators, field lines and the estimate over the passes."""

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import Colormap, ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray
from skfem import MeshTri

from ..result import AdaptResult, Pass
from ..showing import DECADES, in_unit, level_of_share, one_per, outlined_facets
from ..triangles import area
from .lengths import set_axes

__all__ = [
    "adaptation_figure",
    "draw_field_lines",
    "draw_indicators",
    "draw_mesh",
    "draw_passes",
    "indicator_scale",
]

Floats = NDArray[np.float64]

# Okabe and Ito's colours, which the colour-blind tell apart.
BLUE, VERMILION = "#0072b2", "#d55e00"
# One hue, without its dark end, so that black lines stand out on every shade.
PALE = ListedColormap(colormaps["Blues"](np.linspace(0.0, 0.75, 256)), name="pale blues")

OUTLINE = 0.9
"""Width of the lines around regions, points."""

LONGEST = 50_000
"""Facets in one line."""


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
) -> Figure:
    """Mesh and indicators before and after, field lines, and the estimate over the passes, on one page.

    Parameters
    ----------
    before
        The input: the result of ``adapt(..., passes=0)``.
    after
        The adapted result.
    potential
        (nnodes,), nodal values on ``after.mesh``; their contours are the field lines.
    magnitude
        (nelements,), what is coloured under the field lines.
    magnitude_label, indicator_label
        Labels of the colour bars, with units.
    lines_title
        What the contours are.
    unit
        Unit of the axes: "m" or "mm" for a mesh in metres, "" for one without a unit.
    errors
        The exact error of every pass, where it is known.

    Returns
    -------
    Figure
        To be saved by ``figure.savefig(path)``.

    Raises
    ------
    ValueError
        If an array has the wrong shape or the unit is unknown.
    """
    figure = Figure(figsize=(13.0, 7.6), dpi=160, layout=ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.1))
    panels = figure.subplots(2, 3)
    norm = indicator_scale(before.indicators, after.indicators)
    for column, (word, result) in enumerate([("before", before), ("after", after)]):
        draw_mesh(panels[0, column], result.mesh, unit=unit)
        panels[0, column].set_title(f"Mesh {word}: {result.mesh.p.shape[1]} nodes")
        shades = draw_indicators(panels[1, column], result.mesh, result.indicators, norm=norm, unit=unit)
        panels[1, column].set_title(f"Error indicators {word}")
    figure.colorbar(shades, ax=panels[1, 1], label=indicator_label, extend="min")
    colours = draw_field_lines(panels[0, 2], after.mesh, potential, magnitude, unit=unit)
    figure.colorbar(colours, ax=panels[0, 2], label=magnitude_label, extend="max")
    panels[0, 2].set_title(f"{lines_title} after")
    draw_passes(panels[1, 2], after.history, errors=errors)
    panels[1, 2].set_title("Estimate over the passes")
    return figure


def draw_mesh(axes: Axes, mesh: MeshTri, *, unit: str = "m") -> None:
    """Draw the edges of a mesh, the outlines of its regions thicker.

    Parameters
    ----------
    axes
        Where to.
    mesh
        The mesh.
    unit
        Unit of the axes, "m", "mm" or "".

    Examples
    --------
    >>> import skfem
    >>> from matplotlib.figure import Figure
    >>> from kohonen_adapt.plotting import draw_mesh
    >>> mesh, figure = skfem.MeshTri().refined(3), Figure()
    >>> draw_mesh(figure.add_subplot(), mesh, unit="mm")
    >>> figure.savefig("mesh.png")
    """
    # Thinner lines on finer meshes, down to where they would vanish.
    width = float(np.clip(20.0 / np.sqrt(mesh.t.shape[1]), 0.08, 0.5))
    inner = np.setdiff1d(np.arange(mesh.facets.shape[1]), outlined_facets(mesh))
    _draw_facets(axes, mesh, inner, unit, "0.4", width)
    _draw_outline(axes, mesh, unit, "black")
    set_axes(axes, mesh, unit)


def draw_indicators(
    axes: Axes, mesh: MeshTri, indicators: ArrayLike, *, norm: Normalize | None = None, unit: str = "m"
) -> PolyCollection:
    """Colour every element by its error indicator.

    Parameters
    ----------
    axes
        Where to.
    mesh
        The mesh.
    indicators
        (nelements,), unsquared.
    norm
        The scale, for several pictures on one; by default that of these indicators.
    unit
        Unit of the axes, "m", "mm" or "".

    Returns
    -------
    PolyCollection
        For ``figure.colorbar``.

    Examples
    --------
    >>> import numpy as np, skfem
    >>> from matplotlib.figure import Figure
    >>> from kohonen_adapt.plotting import draw_indicators
    >>> mesh, figure = skfem.MeshTri().refined(3), Figure()
    >>> colours = draw_indicators(figure.add_subplot(), mesh, np.linspace(0.1, 1.0, 128))
    >>> bar = figure.colorbar(colours, label="indicator")
    >>> figure.savefig("indicators.png")
    """
    values = one_per(mesh.t.shape[1], indicators, "indicators", "nelements")
    colours = colormaps["viridis"]
    colours = colours.with_extremes(bad=colours(0))  # an indicator of zero has no logarithm
    shades = _draw_elements(axes, mesh, values, unit, norm or indicator_scale(values), colours)
    _draw_outline(axes, mesh, unit, "white")
    set_axes(axes, mesh, unit)
    return shades


def draw_field_lines(
    axes: Axes, mesh: MeshTri, potential: ArrayLike, magnitude: ArrayLike, *, lines: int = 20, unit: str = "m"
) -> PolyCollection:
    """Draw contours of a nodal potential, for A_z the flux lines, over a quantity that is constant per element.

    Parameters
    ----------
    axes
        Where to.
    mesh
        The mesh.
    potential
        (nnodes,); between neighbouring lines it changes by the same amount.
    magnitude
        (nelements,); the colours end where 1 % of the area has more.
    lines
        How many contours.
    unit
        Unit of the axes, "m", "mm" or "".

    Returns
    -------
    PolyCollection
        For ``figure.colorbar``.

    Examples
    --------
    >>> import numpy as np, skfem
    >>> from matplotlib.figure import Figure
    >>> from kohonen_adapt.plotting import draw_field_lines
    >>> mesh, figure = skfem.MeshTri().refined(3), Figure()
    >>> colours = draw_field_lines(figure.add_subplot(), mesh, mesh.p[0], np.ones(128), lines=10)
    >>> bar = figure.colorbar(colours, label="|B| (T)")
    >>> figure.savefig("lines.png")
    """
    potential = one_per(mesh.p.shape[1], potential, "potential", "nnodes")
    magnitude = one_per(mesh.t.shape[1], magnitude, "magnitude", "nelements")
    norm = Normalize(0.0, level_of_share(magnitude, area(mesh), 0.99))
    colours = _draw_elements(axes, mesh, magnitude, unit, norm, PALE)
    x, y = in_unit(unit) * mesh.p
    low, high = potential.min(), potential.max()
    if high > low:
        levels = np.linspace(low, high, lines + 2)[1:-1]
        axes.tricontour(x, y, mesh.t.T, potential, levels=levels, colors="black", linewidths=0.5, linestyles="solid")
    _draw_outline(axes, mesh, unit, "black")
    set_axes(axes, mesh, unit)
    return colours


def draw_passes(axes: Axes, history: Sequence[Pass], *, errors: Sequence[float] | None = None) -> None:
    """Draw the estimate over the passes, in per cent of the energy norm where every pass has one.

    Parameters
    ----------
    axes
        Where to.
    history
        The passes.
    errors
        The exact error of every pass, in the same norm.
    """
    norms = [step.energy_norm for step in history]
    percent = all(norms)
    scale = np.array([100.0 / norm if percent and norm else 1.0 for norm in norms])
    number = [step.number for step in history]
    axes.plot(number, scale * [step.estimate for step in history], "o-", color=BLUE, label="estimate")
    if errors is not None:
        exact = scale * one_per(len(history), errors, "errors", "passes")
        axes.plot(number, exact, "s--", color=VERMILION, label="exact error")
        axes.legend()
    counts = sorted({step.mesh.p.shape[1] for step in history})
    axes.set_xlabel(f"relocations, with {' to '.join(map(str, counts[:: max(len(counts) - 1, 1)]))} nodes")
    axes.set_ylabel("energy error (% of the energy norm)" if percent else "energy error")
    axes.set_ylim(bottom=0.0)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(color="0.9")
    axes.set_axisbelow(True)


def indicator_scale(*indicators: ArrayLike) -> Normalize:
    """One logarithmic scale for several arrays of indicators: three decades below the largest of them.

    Parameters
    ----------
    indicators
        Any number of arrays.

    Returns
    -------
    Normalize
        For ``draw_indicators(..., norm=)``.
    """
    largest = max((float(np.max(values)) for values in indicators), default=0.0)
    return LogNorm(10.0**-DECADES * largest, largest) if largest > 0.0 else Normalize(0.0, 1.0)


def _draw_elements(
    axes: Axes, mesh: MeshTri, values: Floats, unit: str, norm: Normalize, colours: Colormap
) -> PolyCollection:
    x, y = in_unit(unit) * mesh.p
    # Edges in the colour of their element leave no light seams between elements.
    return axes.tripcolor(
        x, y, mesh.t.T, facecolors=values, norm=norm, cmap=colours, edgecolors="face", linewidths=0.2, rasterized=True
    )


def _draw_facets(axes: Axes, mesh: MeshTri, facets: NDArray[np.integer], unit: str, colour: str, width: float) -> None:
    """Lines with gaps: a collection would make an object of every facet, and Agg limits the size of a single line."""
    for part in np.array_split(facets, max(1, -(-len(facets) // LONGEST))):
        ends = in_unit(unit) * mesh.p[:, mesh.facets[:, part]]
        x, y = np.concatenate([ends, np.full((2, 1, len(part)), np.nan)], axis=1).transpose(0, 2, 1).reshape(2, -1)
        axes.add_line(Line2D(x, y, color=colour, linewidth=width, solid_capstyle="round", rasterized=True))


def _draw_outline(axes: Axes, mesh: MeshTri, unit: str, colour: str) -> None:
    _draw_facets(axes, mesh, outlined_facets(mesh), unit, colour, OUTLINE)
