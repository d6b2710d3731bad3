"""What would go wrong with a mesh: units, names, seams, hanging and pinched nodes, bad elements, thin parts."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree
from skfem import MeshTri

from kohonen_adapt.arrays import Ints
from kohonen_adapt.commands.description import counted, memberships
from kohonen_adapt.mesh.measures import quality
from kohonen_adapt.outline.layers import bands_of, check_number, parts_of
from kohonen_adapt.som.kohonen_map import KohonenMap

__all__ = ["faults", "thin_parts", "unit_doubts"]

LARGE = 2.0  # m: devices drawn in metres are smaller, in millimetres larger
SAME = 1e-9  # of the size of the mesh, or of a facet: nodes nearer than that are in the same place
MIN_QUALITY = 0.3  # what `adapt` keeps where nothing else is asked
SHOWN = 3  # places of a kind


def faults(mesh: MeshTri) -> Iterator[str]:
    """Sentences about a valid mesh, one for each kind of fault: what it is, where, and what to do."""
    yield from unit_doubts(mesh)
    yield from _names(mesh)
    rim = mesh.boundary_facets()
    if len(nodes := _on_others(mesh, rim)):
        yield (
            f"{_said(mesh, nodes, 'coincident rim node')}: the parts on both sides are not connected "
            "there. If that is no slit, merge them (Gmsh: Coherence, or BooleanFragments)."
        )
    if len(nodes := _hanging(mesh, rim)):
        yield (
            f"{_said(mesh, nodes, 'hanging node')}, inside an edge of another triangle, so the "
            "field has a gap there. Mesh both sides together."
        )
    if len(nodes := _pinched(mesh, rim)):
        yield (
            f"{_said(mesh, nodes, 'pinched node')}: parts of the mesh touch in a point only; such a node "
            "stays where it is."
        )
    yield from _bad_elements(mesh)


def thin_parts(som: KohonenMap) -> Iterator[str]:
    """Sentences about subdomains with one layer of elements between two sides; of a map without layers."""
    triangulation, constraints = som.triangulation, som.outline.constraints
    for name, rows in (triangulation.mesh.subdomains or {}).items():
        if name.startswith("gmsh:") or not len(rows):
            continue
        for inside in parts_of(triangulation.elements, triangulation.region_of_input[np.asarray(rows)]):
            try:
                bands = bands_of(triangulation, constraints, name, 2, inside)
            except ValueError:  # no sides that face each other: it is not thin
                continue
            for band in bands:
                try:
                    check_number(triangulation.position, band)
                except ValueError as error:
                    yield f"{str(error).partition(';')[0]}: a field across it is poor. Refine it there."


def unit_doubts(mesh: MeshTri) -> Iterator[str]:
    """A sentence about a mesh that is too large for a device in metres."""
    width, height = np.ptp(mesh.p, axis=1)
    if max(width, height) > LARGE:
        yield (
            f"the mesh is {width:.4g} x {height:.4g} m: that looks like millimetres. If so, --scale 1e-3 (scale = 1e-3 "
            "in a case)."
        )


def _names(mesh: MeshTri) -> Iterator[str]:
    count = memberships(mesh)
    for which, said in ((count == 0, "no subdomain"), (count > 1, "more than one subdomain")):
        if which.any():
            x, y = mesh.p[:, mesh.t[:, np.argmax(which)]].mean(axis=1)
            yield (
                f"{np.sum(which)} triangles are in {said}, one near ({x:.6g}, {y:.6g}): a case needs exactly one "
                "material for each. Give every surface one physical group, or name the materials so that they do not "
                "overlap."
            )
    if not any(not name.startswith("gmsh:") for name in mesh.boundaries or ()):
        yield "no boundary has a name, so a case can fix no potential: give the rim a physical group of lines."


def _bad_elements(mesh: MeshTri) -> Iterator[str]:
    value = quality(mesh)
    bad = np.flatnonzero(value < MIN_QUALITY)
    if len(bad):
        x, y = mesh.p[:, mesh.t[:, bad[np.argmin(value[bad])]]].mean(axis=1)
        yield (
            f"{len(bad)} triangles have a quality below {MIN_QUALITY}, the default of min_quality; the worst, "
            f"{value.min():.3g}, is near ({x:.6g}, {y:.6g}). They get no worse, and hardly move where all are so."
        )


def _on_others(mesh: MeshTri, rim: Ints) -> Ints:
    nodes = np.unique(mesh.facets[:, rim])
    found = cKDTree(mesh.p[:, nodes].T).query_pairs(SAME * np.ptp(mesh.p, axis=1).max(), output_type="ndarray")
    return nodes[np.unique(found)]


def _hanging(mesh: MeshTri, rim: Ints) -> Ints:
    """Rim nodes inside a facet of the rim."""
    ends = mesh.p[:, mesh.facets[:, rim]]
    along = ends[:, 1] - ends[:, 0]
    length = np.hypot(*along)
    nodes = np.unique(mesh.facets[:, rim])
    tree = cKDTree(mesh.p[:, nodes].T)
    near = tree.query_ball_point(ends.mean(axis=1).T, 0.5 * length * (1.0 - SAME))
    facet = np.repeat(np.arange(len(rim)), [len(found) for found in near])
    node = nodes[np.concatenate([np.asarray(found, dtype=np.int64) for found in near])]
    off = mesh.p[:, node] - ends[:, 0, facet]
    distance = np.abs(along[0, facet] * off[1] - along[1, facet] * off[0]) / length[facet]
    return np.unique(node[distance < SAME * length[facet]])


def _pinched(mesh: MeshTri, rim: Ints) -> Ints:
    return np.flatnonzero(np.bincount(mesh.facets[:, rim].ravel()) > 2)


def _said(mesh: MeshTri, nodes: Ints, what: str) -> str:
    places = ", ".join(f"({x:.6g}, {y:.6g})" for x, y in mesh.p[:, nodes[:SHOWN]].T)
    return f"{counted(len(nodes), what)}, at {places}{', ...' if len(nodes) > SHOWN else ''}"
