"""Drawings of meshes, element values and field lines on matplotlib axes."""

from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import Collection, PolyCollection
from matplotlib.colors import Colormap, ListedColormap, LogNorm, Normalize
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike
from skfem import Mesh, MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import as_reals
from kohonen_adapt.display import (
    PARTS,
    decades_of,
    divided,
    divisions_of,
    field_values,
    in_unit,
    lattice,
    level_of_share,
    outlined_facets,
    straight_and_curved,
    straight_and_curved_elements,
)
from kohonen_adapt.mesh.curved import is_second_order
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.slicing import CutBy, Flat, flat

__all__ = [
    "BESIDE",
    "COLOURS",
    "draw_edges",
    "draw_elements",
    "draw_field_lines",
    "draw_indicators",
    "draw_mesh",
    "draw_outline",
    "in_view",
    "indicator_scale",
    "set_axes",
]

# Colours of Okabe and Ito that are visible on white, distinct for colour-blind readers; blue and vermilion first.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")

BESIDE: dict[str, Any] = {
    "loc": "upper left", "bbox_to_anchor": (1.01, 1.0), "borderaxespad": 0.0, "fontsize": "small", "frameon": False,
}  # fmt: skip
"""Keywords of a legend to the right of the axes."""

# Blues without the dark end, so that black lines are visible on every shade.
PALE = ListedColormap(colormaps["Blues"](np.linspace(0.0, 0.75, 256)), name="pale blues")

OUTLINE = 0.9  # width of the lines around regions, in points
MARGIN = 0.02  # around the mesh, relative to its size
LONGEST = 50_000  # maximum number of facets in one line


def draw_mesh(
    axes: Axes, mesh: Mesh, *, plane: CutBy | None = None, unit: str = "m", axisymmetric: bool = False
) -> None:
    """Draw the edges of a mesh, with thicker lines around its regions.

    A mesh of tetrahedra is drawn as a cut, with lines where the plane meets the faces.

    Parameters
    ----------
    axes
        Axes to draw on.
    mesh
        The mesh.
    plane
        Cutting plane for a mesh of tetrahedra, a `kohonen_adapt.Plane`. In a plane along two axes, coordinates are
        those of the mesh.
    unit
        Unit of the axes, "m", "mm" or "".
    axisymmetric
        True to name the axes r and z, for a mesh around an axis.

    Raises
    ------
    ValueError
        If no plane that cuts the mesh is given for tetrahedra, if a plane is given for triangles, or if the unit is
        unknown.

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
    shown = in_view(mesh, plane, unit, axisymmetric)
    width = float(np.clip(20.0 / np.sqrt(shown.mesh.nelements), 0.08, 0.5))
    draw_edges(axes, shown, "0.4", width)
    draw_outline(axes, shown, "black")


def in_view(mesh: Mesh, plane: CutBy | None, unit: str, axisymmetric: bool = False) -> Flat:
    """Return the triangles to draw, with positions and names of the axes in the unit."""
    shown = flat(mesh, plane, axisymmetric)
    across, up = (f"{name} ({unit})" if unit else name for name in shown.axes)
    return replace(shown, mesh=shown.mesh.scaled(in_unit(unit)), axes=(across, up))


def draw_edges(axes: Axes, shown: Flat, colour: str, width: float) -> None:
    inner = np.setdiff1d(shown.sides, outlined_facets(shown.mesh))
    _draw_facets(axes, shown.mesh, inner, colour, width)


def draw_indicators(
    axes: Axes,
    mesh: Mesh,
    indicators: ArrayLike,
    *,
    norm: Normalize | None = None,
    plane: CutBy | None = None,
    unit: str = "m",
    axisymmetric: bool = False,
) -> Collection:
    """Colour every element by its error indicator, on a logarithmic scale.

    Parameters
    ----------
    axes, mesh, plane, unit, axisymmetric
        As in `draw_mesh`.
    indicators
        Unsquared indicators, (nelements,).
    norm
        Colour scale, to share between several pictures; by default the scale of these indicators.

    Returns
    -------
    Collection
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
    values = as_reals("indicators", indicators, {"nelements": mesh.nelements})
    colours = colormaps["viridis"]
    colours = colours.with_extremes(bad=colours(0))  # an indicator of zero has no logarithm
    shown = in_view(mesh, plane, unit, axisymmetric)
    shades = draw_elements(axes, shown.mesh, shown.of_elements(values), norm or indicator_scale(values), colours)
    draw_outline(axes, shown, "white")
    return shades


def draw_field_lines(
    axes: Axes,
    mesh: Mesh,
    potential: ArrayLike,
    magnitude: ArrayLike,
    *,
    lines: int = 20,
    plane: CutBy | None = None,
    unit: str = "m",
    axisymmetric: bool = False,
) -> Collection:
    """Draw contours of a potential over the magnitude of a field.

    For A_z the contours are flux lines.

    Parameters
    ----------
    axes, mesh, plane, unit, axisymmetric
        As in `draw_mesh`.
    potential
        Values at the corners of elements, (nnodes,), linear in every element. The levels of the contours are equally
        spaced.
    magnitude
        Values (nelements,), constant in every element. The colour scale ends at the value that 1 % of the area exceeds.

        For elements of higher order, potential and magnitude may have shape (k, nelements), with values at the points
        of a `kohonen_adapt.display.lattice` in every element and linear between them.
    lines
        Number of contours.

    Returns
    -------
    Collection
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
    shown = in_view(mesh, plane, unit, axisymmetric)
    magnitude = shown.of_elements(field_values("magnitude", magnitude, mesh, nodal=False))
    potential = shown.of_nodes(field_values("potential", potential, mesh, nodal=True))
    mesh = shown.mesh
    weights = np.broadcast_to(area(mesh), magnitude.shape).ravel()
    norm = Normalize(0.0, level_of_share(magnitude.ravel(), weights, 0.99))
    colours = draw_elements(axes, mesh, magnitude, norm, PALE)
    low, high = potential.min(), potential.max()
    if high > low:
        levels = np.linspace(low, high, lines + 2)[1:-1]
        if is_second_order(mesh):
            potential = _on_finer_lattice(mesh, potential if potential.ndim == 2 else potential[mesh.t])
        fine = mesh if potential.ndim == 1 else divided(mesh, divisions_of(len(potential)))
        axes.tricontour(
            *fine.p, fine.t.T, potential.ravel(), levels=levels, colors="black", linewidths=0.5, linestyles="solid"
        )
    draw_outline(axes, shown, "black")
    return colours


def _on_finer_lattice(mesh: MeshTri, values: Floats) -> Floats:
    return lattice(PARTS)[0].T @ values if is_second_order(mesh) and len(values) == 3 else values


def indicator_scale(*indicators: ArrayLike) -> Normalize:
    """Return a logarithmic colour scale for several arrays of indicators.

    The scale covers three decades below the largest indicator, or more, so that it covers at least one decade of every
    array.

    Parameters
    ----------
    indicators
        Any number of arrays.

    Returns
    -------
    Normalize
        For ``draw_indicators(..., norm=)``.
    """
    low, high = decades_of([np.asarray(values) for values in indicators])
    return LogNorm(low, high) if high > 0.0 else Normalize(0.0, 1.0)


def set_axes(axes: Axes, shown: Flat) -> None:
    axes.set(aspect="equal", xlabel=shown.axes[0], ylabel=shown.axes[1])
    axes.use_sticky_edges = False  # contours leave no margin
    axes.margins(MARGIN)


def draw_elements(axes: Axes, mesh: MeshTri, values: Floats, norm: Normalize, colours: Colormap) -> Collection:
    # Values of shape (nelements,) are constant in each element; values of shape (k, nelements) are given on a lattice
    # and linear between its points.
    if values.ndim == 2:
        values = _on_finer_lattice(mesh, values)
        fine = divided(mesh, divisions_of(len(values)))
        return axes.tripcolor(
            *fine.p, fine.t.T, values.ravel(), norm=norm, cmap=colours, shading="gouraud", rasterized=True
        )
    # Edges in the colour of the element close the light gaps of antialiasing.
    look: Any = {"norm": norm, "cmap": colours, "edgecolors": "face", "linewidths": 0.2, "rasterized": True}
    if is_second_order(mesh):
        straight, curved, outlines = straight_and_curved_elements(mesh)
        polygons = [*mesh.p[:, mesh.t[:, straight]].T, *outlines]
        shades = PolyCollection(polygons, array=values[np.concatenate([straight, curved])], **look)
        axes.add_collection(shades, autolim=False)
        return shades
    return axes.tripcolor(*mesh.p, mesh.t.T, facecolors=values, **look)


def _draw_facets(axes: Axes, mesh: MeshTri, facets: Ints, colour: str, width: float) -> None:
    for part in np.array_split(facets, max(1, -(-len(facets) // LONGEST))):
        straight, curved = straight_and_curved(mesh, part)
        for points in (mesh.p[:, mesh.facets[:, straight]], curved):
            if not points.size:
                continue
            gaps = np.full((2, 1, points.shape[2]), np.nan)
            x, y = np.concatenate([points, gaps], axis=1).transpose(0, 2, 1).reshape(2, -1)
            axes.add_line(Line2D(x, y, color=colour, linewidth=width, solid_capstyle="round", rasterized=True))


def draw_outline(axes: Axes, shown: Flat, colour: str) -> None:
    _draw_facets(axes, shown.mesh, outlined_facets(shown.mesh), colour, OUTLINE)
    set_axes(axes, shown)
