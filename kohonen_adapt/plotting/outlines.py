"""Boundaries and interfaces drawn with the constraints on their nodes.

A curve segment from corner to corner is called a chain.
"""

from collections import Counter, defaultdict
from collections.abc import Sequence
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from scipy.sparse import coo_array
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask, Texts
from kohonen_adapt.display import counted, in_unit, listed_numbers
from kohonen_adapt.geometry.held_nodes import reasons_in_plane, with_pins, without_turns
from kohonen_adapt.geometry.plane.curves import Curves
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.outline import Outline
from kohonen_adapt.geometry.plane.polylines import constrained_facets
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.mesh.measures import unit_vectors
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.plotting.drawing import BESIDE, COLOURS, in_view, set_axes

__all__ = ["plot_outlines"]

LABELLED = 0.08  # minimum size of a curve segment with a label, relative to the mesh
ROOM = np.array([0.2, 0.05])  # minimum distance of labels in x and y, relative to the mesh
STEP = np.deg2rad(2.0)  # angle between points drawn on a circle
LISTED_RADII = 4  # maximum number of radii in the legend
LISTED = 8  # maximum number of reasons in the legend
# Colours of reasons, dark and away from the colours of curve segments; the last one is for all further reasons.
REASON_COLOURS = ("#882255", "#117733", "#332288", "#999933", "#44aa99", "#cc6677", "#661100", "#6699cc", "#888888")
MIDSIDE_DASHES = (0, (6.0, 1.5, 1.0, 1.5, 1.0, 1.5))  # dashes of splines through midside nodes


def plot_outlines(
    mesh: MeshTri,
    *,
    pinned: Sequence[int | str] | Ints | str = (),
    curves: Curves | None = None,
    periodic: Sequence[Pair] = (),
    ax: Axes | None = None,
    unit: str = "m",
    axisymmetric: bool = False,
) -> Axes:
    """Draw the outlines of a mesh and the constraints on its nodes.

    Outlines are the boundaries and interfaces. Each consists of curve segments ("chains") from corner to corner, drawn
    in different colours where they meet. Straight segments are solid lines, recognised arcs and circles are dashed and
    have their radius beside them. Splines through the midside nodes of a `skfem.MeshTri2` are dash-double-dotted,
    segments on user-defined curves dotted, periodic segments dash-dotted. Grey lines show the facets.

    Corners are squares. A filled square is a node that never moves, and a hollow square one whose place another node
    may take (where three segments meet, only if edges may flip). Sliding nodes are black dots, free nodes grey dots.
    The colour of a square is the reason that holds the node, as of `kohonen_adapt.why_held`.

    Parameters
    ----------
    mesh
        The mesh, in metres if `unit` is "m" or "mm".
    pinned, curves, periodic
        As in `relocate`.
    ax
        Axes to draw on; None creates a figure, ``plot_outlines(mesh).figure``.
    unit
        Unit of the axes and radii, "m", "mm" or "".
    axisymmetric
        As of `draw_mesh`.

    Returns
    -------
    Axes
        With a legend that counts segments, nodes of each kind and held nodes by reason.

    Raises
    ------
    ValueError
        If `relocate` would refuse the arguments, or if the unit is unknown.

    Examples
    --------
    >>> import skfem
    >>> from kohonen_adapt.plotting import plot_outlines
    >>> plot_outlines(skfem.MeshTri.init_circle(3)).figure.savefig("outlines.png")
    """
    rules = Rules(pinned=pinned, curves=curves, periodic=periodic)
    movable = MovableMesh.of(mesh, rules)
    triangulation, outline = movable.triangulation, movable.outline
    axes = Figure(figsize=(9.0, 6.0), layout="compressed").subplots() if ax is None else ax
    facets = constrained_facets(triangulation.mesh, triangulation.elements)
    ends, chain = facets.nodes, triangulation.elements.chain[facets.element, facets.corner]
    position = in_unit(unit) * triangulation.position
    axes.add_collection(LineCollection([*position[ends]], colors="0.8", linewidths=0.5))
    _draw_chains(axes, outline, _colours(ends, chain, len(outline.curve_index)), np.bincount(chain), unit)
    freedoms = outline.nodes_by_freedom()
    size = float(np.clip(120.0 / np.sqrt(max(int(np.sum(~freedoms["free"])), 1)), 1.5, 6.0))  # of a square
    looks = (("o", "0.7", 0.25 * size), ("o", "black", 0.35 * size), ("s", "white", size), ("s", "black", size))
    for (label, mask), (marker, face, width) in zip(freedoms.items(), looks, strict=True):
        if mask.any():
            axes.plot(
                *position[mask].T, marker, color=face, markeredgecolor="black" if face == "white" else face,
                markersize=width, label=f"{counted(int(np.sum(mask)), 'node')} {label}", zorder=3,
                markeredgewidth=0.8 if marker == "s" else 0.0, rasterized=True,
            )  # fmt: skip
    why = without_turns(np.array(with_pins(reasons_in_plane(movable), mesh, pinned), np.str_))
    _draw_reasons(axes, why, freedoms["fixed"], position, size)
    sagitta = in_unit(unit) * outline.farthest(triangulation)[0]
    if sagitta > 0.0:
        label = f"facets, up to {sagitta:.3g} {unit}".rstrip() + " off their curves"
        axes.plot([], [], color="0.8", linewidth=0.5, label=label)
    set_axes(axes, in_view(mesh, None, unit, axisymmetric))
    axes.legend(**BESIDE)
    return axes


def _colours(ends: Ints, chain: Ints, count: int) -> Texts:
    on = coo_array((np.ones(ends.size), (ends.ravel(), np.repeat(chain, 2))), (ends.max() + 1, count)).tocsr()
    meetings, found = (on.T @ on).tolil().rows, np.full(count, -1)
    for c, meeting in enumerate(meetings):
        wanted = [(c + shift) % len(COLOURS) for shift in range(len(COLOURS))]
        found[c] = next((colour for colour in wanted if colour not in found[meeting]), wanted[0])
    return np.array(COLOURS)[found]


def _draw_chains(axes: Axes, outline: Outline, colours: Texts, facets: Ints, unit: str) -> None:
    chains = outline.constraints.chains
    curve_index = outline.curve_index >= 0
    plain = ~chains.paired & ~curve_index
    recognised = outline.on_circles & plain
    lines = [in_unit(unit) * line for line in _lines_of(outline, facets)]
    with np.errstate(divide="ignore"):  # straight segments have no curvature
        radii = in_unit(unit) / np.abs(chains.curvature)
    shown = listed_numbers(radii[recognised], LISTED_RADII)
    for mask, style, label in (
        (plain & outline.straight, "solid", "straight"),
        (plain & ~outline.straight & ~recognised, MIDSIDE_DASHES, "on a spline through midside nodes"),
        (recognised, (0, (4.0, 1.5)), f"recognised as arc or circle,\nradius {shown} {unit}".rstrip()),
        (curve_index & ~chains.paired, (0, (1.0, 1.0)), "on a given curve"),
        (chains.paired, (0, (6.0, 1.5, 1.0, 1.5)), "periodic, matched with another"),
    ):
        if mask.any():
            some = [lines[c] for c in np.flatnonzero(mask)]
            axes.add_collection(LineCollection(some, colors=colours[mask], linewidths=1.8, linestyles=style))
            axes.plot([], [], color="black", linestyle=style, label=f"{counted(len(some), 'chain')} {label}")
    labels: dict[int, list[str]] = defaultdict(list)
    for name, manner in outline.names.items():
        for c in np.flatnonzero(manner).tolist():
            labels[c].append(name)
    for c in np.flatnonzero(recognised).tolist():
        labels[c].append(f"r = {radii[c]:.4g} {unit}".rstrip())
    low, high = (bound(np.concatenate(lines), axis=0) for bound in (np.min, np.max))
    middle, size = 0.5 * (low + high), np.max(high - low)
    extent = [np.ptp(line, axis=0).max() for line in lines]
    every = np.arange(len(lines), dtype=np.int32)
    before, place, after = (in_unit(unit) * outline.points_on(every, at * chains.length) for at in (0.49, 0.5, 0.51))
    normals = unit_vectors((after - before).T[::-1]).T * [-1.0, 1.0]
    normals *= np.where(np.sum(normals * (middle - place), axis=1) < 0.0, -1.0, 1.0)[:, None]
    taken: list[Floats] = []
    for c in sorted(labels, key=lambda c: -extent[c]):
        is_free = all(np.any(np.abs(place[c] - other) > ROOM * size) for other in taken)
        if extent[c] >= LABELLED * size and is_free:
            _write(axes, place[c], normals[c], ", ".join(labels[c]), colours[c])
            taken.append(place[c])


def _lines_of(outline: Outline, facets: Ints) -> list[Floats]:
    """Return points (n, 2) along every curve segment, dense enough for its curvature."""
    chains = outline.constraints.chains
    turn = np.abs(chains.curvature) * chains.length
    parts = np.where(outline.on_circles, np.ceil(turn / STEP), np.where(outline.straight, 1, 8 * facets))
    stop = np.cumsum(parts.astype(int) + 1)
    chain = np.repeat(np.arange(len(stop), dtype=np.int32), np.diff(stop, prepend=0))
    fraction = (np.arange(len(chain)) - np.append(0, stop)[chain]) / parts[chain]
    return np.split(outline.points_on(chain, fraction * chains.length[chain]), stop[:-1])


def _write(axes: Axes, at: Floats, normal: Floats, text: str, colour: str) -> None:
    alignments = [("right", "center", "left"), ("top", "center", "bottom")]
    ha, va = (alignment[1 + round(fraction)] for alignment, fraction in zip(alignments, normal, strict=True))
    offset = (6.0 * normal[0], 6.0 * normal[1])
    axes.annotate(
        text, (at[0], at[1]), offset, textcoords="offset points", color=colour, fontsize="small", ha=ha, va=va,
        zorder=5, parse_math=False,  # a name may contain dollar signs
    )  # fmt: skip


def _draw_reasons(axes: Axes, why: Texts, never: Mask, position: Floats, size: float) -> None:
    counts = Counter(why[why != ""].tolist()).most_common()
    for k, (reason, count) in enumerate(counts):
        colour, held = REASON_COLOURS[min(k, LISTED)], why == reason
        for mask, face in ((held & never, colour), (held & ~never, "white")):
            x, y = position[mask].T
            axes.scatter(x, y, size**2, marker="s", color=face, edgecolors=colour, linewidths=1.6, zorder=4)
        if k <= LISTED:
            further = sum(number for _, number in counts[k:])
            text = f"{count}: {reason}" if k < LISTED else f"{further}: {counted(len(counts) - k, 'further reason')}"
            text = fill(text, 44, subsequent_indent="    ").replace("$", r"\$")  # a name may contain dollar signs
            axes.scatter([], [], marker="s", color=colour, label=text)
