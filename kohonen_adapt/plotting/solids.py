"""Meshes of tetrahedra drawn as cuts and from outside."""

from collections.abc import Iterable, Mapping

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import ListedColormap, Normalize, to_rgb
from matplotlib.patches import Patch
from numpy.typing import ArrayLike
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import as_reals, with_nearest_names
from kohonen_adapt.display import in_unit
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.coils.placement import listed_coils
from kohonen_adapt.mesh.cells import check_kind, normals
from kohonen_adapt.mesh.curved import Isoparametric
from kohonen_adapt.mesh.host import count_unknowns, edges_between
from kohonen_adapt.mesh.measures import directed, unit_vectors
from kohonen_adapt.mesh.names import labelled, named_sets
from kohonen_adapt.mesh.slicing import CutBy, cut_triangles
from kohonen_adapt.plotting.charts import axes_of
from kohonen_adapt.plotting.drawing import BESIDE, COLOURS, draw_edges, draw_elements, draw_outline, in_view

__all__ = ["plot_slice", "plot_surface"]

WHITE = 0.45  # fraction of white in the colour of a name, so that lines are visible on top
NAMELESS = "#d9dde2"
SHADE = 0.45  # fraction by which a face that turns away from the light is darker
LIGHT = np.array([-0.3, 0.5, 1.0]) / np.linalg.norm([-0.3, 0.5, 1.0])  # in components right, up, towards the viewer
COPPER = "#b4622d"
ARROW = 0.09  # length of the arrows of the axes, as a fraction of the picture


def plot_slice(
    mesh: MeshTet,
    plane: CutBy,
    values: ArrayLike | None = None,
    *,
    label: str = "",
    norm: Normalize | None = None,
    coils: Iterable[Coil] = (),
    ax: Axes | None = None,
    unit: str = "m",
) -> Axes:
    """Draw a cut through a mesh of tetrahedra by a plane.

    Elements have the colours of values or of their subdomains.

    Parameters
    ----------
    mesh
        The mesh. Of a `MeshTet2` the straight tetrahedra are cut.
    plane
        Cutting plane, a `kohonen_adapt.Plane`. If the plane runs along faces of elements, the elements on one of its
        sides are shown.
    values
        Values (nelements,), constant in every element, (nnodes,), linear between the nodes, or of order 2 (nunknowns,),
        at the nodes and then at the middles of ``mesh.edges``. None colours subdomains.
    label
        Label of the colour bar, with a unit.
    norm
        Colour scale, to share between several pictures.
    coils
        Coils whose sections are drawn.
    ax
        Axes to draw on; None creates a figure, ``plot_slice(mesh, plane).figure``.
    unit
        Unit of the axes, "m", "mm" or "".

    Returns
    -------
    Axes
        ``ax.figure.savefig(path)`` saves the figure.

    Raises
    ------
    ValueError
        If the plane does not cut the mesh, if `values` has the wrong shape, if the unit is unknown, or if `coils` are
        no list of coils.

    Examples
    --------
    >>> import kohonen_adapt as ka, skfem
    >>> from kohonen_adapt.plotting import plot_slice
    >>> mesh = skfem.MeshTet().refined(3)
    >>> ax = plot_slice(mesh, ka.Plane((0.5, 0.5, 0.5), (1.0, 1.0, 0.0)), ka.quality(mesh), label="quality")
    >>> ax.figure.savefig("slice.png")
    """
    mesh, coils = _checked(mesh).corners, listed_coils(coils)
    shown, axes = in_view(mesh, plane, unit), axes_of(ax, height=5.0)
    if values is None:
        number, colours, labels = _named_colours(named_sets(shown.mesh.subdomains), shown.mesh.nelements)
        norm = Normalize(-0.5, len(colours) - 0.5)
        draw_elements(axes, shown.mesh, number.astype(float), norm, ListedColormap(colours))
        _add_legend(axes, colours, labels)
    else:
        checked = _values(mesh, values)
        if len(checked) == mesh.nelements:
            found = shown.of_elements(checked)
        else:
            of_nodes = shown.of_nodes(checked[: mesh.nvertices])
            if len(checked) > mesh.nvertices and shown.ends is not None and shown.share is not None:
                rows = np.flatnonzero(shown.ends[0] != shown.ends[1])
                ends, share = shown.ends[:, rows], shown.share[rows]
                middle = checked[mesh.nvertices + edges_between(mesh, *ends)]
                of_nodes[rows] += 4.0 * share * (1.0 - share) * (middle - checked[ends].mean(axis=0))
            found = of_nodes[shown.mesh.t]
        norm = norm or Normalize(checked.min(), checked.max())
        drawn = draw_elements(axes, shown.mesh, found, norm, colormaps["viridis"])
        axes.figure.colorbar(drawn, ax=axes, label=label)
    draw_edges(axes, shown, "0.25", float(np.clip(15.0 / np.sqrt(shown.mesh.nelements), 0.08, 0.5)))
    draw_outline(axes, shown, "black")
    for coil in coils:
        segments = in_unit(unit) * cut_triangles(coil.winding.surface, plane)
        axes.add_collection(LineCollection(list(segments.T), colors=COPPER, linewidths=1.2), autolim=False)
    return axes


@with_nearest_names({"names": "values"})
def plot_surface(
    mesh: MeshTet,
    values: ArrayLike | str = "boundaries",
    *,
    view: tuple[float, float] = (-60.0, 25.0),
    label: str = "",
    norm: Normalize | None = None,
    coils: Iterable[Coil] = (),
    ax: Axes | None = None,
    unit: str = "m",
) -> Axes:
    """Draw a mesh of tetrahedra from outside.

    Boundary faces have the colours of values or of names. Only faces towards the viewer are drawn, from the farthest to
    the nearest, without perspective.

    Parameters
    ----------
    mesh
        The mesh.
    values
        Values (nelements,), or (nnodes,) or of order 2 (nunknowns,) as in `plot_slice`, of which each face shows the
        mean. "boundaries" or "subdomains" colours their names.
    view
        Direction of the viewer in degrees, as azimuth from x around z and elevation above the xy plane.
    label
        Label of the colour bar, with a unit.
    norm
        Colour scale, to share between several pictures.
    coils
        Coils whose edges are drawn, in front of the mesh.
    ax
        Axes to draw on; None creates a figure, ``plot_surface(mesh).figure``.
    unit
        Unit of the dimensions below the picture, "m", "mm" or "".

    Returns
    -------
    Axes
        ``ax.figure.savefig(path)`` saves the figure.

    Raises
    ------
    ValueError
        If `values` has the wrong shape or is another text, if the unit is unknown, or if `coils` are no list of coils.

    Examples
    --------
    >>> import skfem
    >>> from kohonen_adapt.plotting import plot_surface
    >>> mesh = skfem.MeshTet().refined(2).with_boundaries({"top": lambda x: x[2] == 1.0})
    >>> plot_surface(mesh).figure.savefig("surface.png")
    """
    shape, coils = _checked(mesh), listed_coils(coils)
    mesh = shape.corners
    if isinstance(values, str) and values not in ("boundaries", "subdomains"):
        raise ValueError(f'values must be numbers, "boundaries" or "subdomains"; got {values!r}.')
    axes, camera = axes_of(ax, height=5.0), _camera(*view)
    rim = mesh.boundary_facets()
    faces, order, brightness = _faces(shape, rim, camera, in_unit(unit))
    if isinstance(values, str):
        of_face = {"boundaries": rim, "subdomains": mesh.f2t[0, rim]}[values]
        named = {name: np.isin(of_face, rows) for name, rows in named_sets(getattr(mesh, values)).items()}
        there = {name: np.flatnonzero(mask) for name, mask in named.items() if mask.any()}
        number, colours, labels = _named_colours(there, len(rim))
        painted = colours[number]
        _add_legend(axes, colours, labels)
    else:
        checked = _values(mesh, values)
        scale = ScalarMappable(norm or Normalize(checked.min(), checked.max()), "viridis")
        at = mesh.f2t[0, rim] if len(checked) == mesh.nelements else mesh.facets[:, rim]
        if len(checked) > mesh.nvertices and at.ndim == 2:
            at = mesh.nvertices + edges_between(mesh, at, at[[1, 2, 0]])  # with the mean of the face
        painted = scale.to_rgba(np.atleast_2d(checked[at]).mean(axis=0))[:, :3]
        axes.figure.colorbar(scale, ax=axes, label=label)
    faces.set_facecolor(painted[order] * (1.0 - SHADE * (1.0 - np.clip(brightness, 0.0, 1.0)))[:, None])
    axes.add_collection(faces)
    for coil in coils:
        edges = in_unit(unit) * np.einsum("kc,ecm->emk", camera[:2], coil.winding.edges)
        axes.add_collection(PolyCollection(edges, facecolors="none", edgecolors=COPPER, linewidths=1.2))
    axes.autoscale_view()
    sizes = " x ".join(f"{size:.4g}" for size in in_unit(unit) * np.ptp(mesh.p, axis=1))
    axes.set(aspect="equal", xticks=[], yticks=[], xlabel=f"{sizes} {unit}".rstrip())
    axes.spines[:].set_visible(False)
    _draw_arrows(axes, *camera[:2])
    return axes


def _faces(shape: Isoparametric, rim: Ints, camera: Floats, scale: float) -> tuple[PolyCollection, Ints, Floats]:
    mesh = shape.corners
    nodes = directed(mesh, rim, np.zeros_like(rim)).T
    corners, normal = mesh.p[:, nodes], normals(mesh.p.T, nodes.T).T
    seen = np.flatnonzero(camera[2] @ normal > 0.0)
    order = seen[np.argsort(camera[2] @ corners.mean(axis=1)[:, seen], kind="stable")]
    outline = corners
    if shape.side_offset.any():
        following = nodes[[1, 2, 0]]
        middle = 0.5 * (corners + mesh.p[:, following]) + shape.side_offset[:, edges_between(mesh, nodes, following)]
        outline = np.stack([corners, middle], axis=2).reshape(3, 6, -1)
    projected = scale * np.einsum("kc,cif->fik", camera[:2], outline[:, :, order])
    width = float(np.clip(15.0 / np.sqrt(len(order)), 0.05, 0.4))
    drawn = PolyCollection(projected, linewidths=width, edgecolors="0.25", rasterized=True)
    towards_light = (LIGHT @ camera) @ unit_vectors(normal[:, order])
    return drawn, order, towards_light


def _checked(mesh: MeshTet) -> Isoparametric:
    check_kind(mesh)
    if len(mesh.p) != 3:
        raise ValueError("mesh must be a skfem.MeshTet; a mesh of triangles is drawn by draw_mesh.")
    return Isoparametric(mesh)


def _values(mesh: MeshTet, values: ArrayLike) -> Floats:
    size, names = len(np.atleast_1d(values)), {mesh.nvertices: "nnodes", count_unknowns(mesh, 2): "nunknowns"}
    return as_reals("values", values, {names[size]: size} if size in names else {"nelements": mesh.nelements})


def _named_colours(sets: Mapping[str, Ints], count: int) -> tuple[Ints, Floats, list[str]]:
    number, labels = labelled(sets, count)
    chosen = [COLOURS[k % len(COLOURS)] for k in range(len(labels))]
    colours = np.array([WHITE + (1.0 - WHITE) * np.array(to_rgb(colour)) for colour in chosen])
    colours[[not text for text in labels]] = to_rgb(NAMELESS)
    return number, colours, labels


def _add_legend(axes: Axes, colours: Floats, labels: list[str]) -> None:
    if any(labels):
        handles = [Patch(color=colour, label=text or "no name") for colour, text in zip(colours, labels, strict=True)]
        axes.legend(handles=handles, **BESIDE)


def _camera(around: float, above: float) -> Floats:
    turn, rise = np.radians([around, above])
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    towards = np.array([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
    return np.stack([right, np.cross(towards, right), towards])


def _draw_arrows(axes: Axes, right: Floats, up: Floats) -> None:
    for name, tip in zip("xyz", ARROW * np.stack([right, up], axis=1), strict=True):
        look = {"arrowstyle": "<|-", "color": "0.35", "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate(
            name, xy=(0.06, 0.06), xytext=(0.06 + tip[0], 0.06 + tip[1]), xycoords="axes fraction", arrowprops=look,
            ha="center", va="center", color="0.35", fontsize="small", annotation_clip=False,
        )  # fmt: skip
