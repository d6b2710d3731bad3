"""Periodic pairs: boundaries that are one another's image, the motions between them, and nodes that are one."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.facets import Facets, outline_facets
from kohonen_adapt.outline.rules import checked_pairs

__all__ = ["Pairs", "find_pairs", "image_nodes"]

MATCH = 1e-8  # of the size of the mesh: paired nodes are no farther from one another's image


class Pairs(NamedTuple):
    """Which nodes and outline facets belong together, and how the mesh goes on beyond them; see `Twins`."""

    partner: NDArray[np.int32]  # (n,)
    motion: NDArray[np.int32]  # (n,)
    motions: Floats  # (k, 2, 3), those there and back one after the other
    facet: Ints  # (f,) the outline facet that is one with this one, -1 for most
    facet_motion: Ints  # (f,) the motion that carries a facet there, -1 likewise


def find_pairs(triangulation: Triangulation, facets: Facets, periodic: Sequence[tuple[str, str]]) -> Pairs:
    """Find the translation or rotation that carries the first boundary of every pair onto the second.

    Refuses what `checked_pairs` does, and pairs whose nodes do not match.
    """
    mesh, n = triangulation.mesh, triangulation.nnodes
    partner, motion = np.full(n, -1, dtype=np.int32), np.full(n, -1, dtype=np.int32)
    facet_motion, motions = np.full(len(facets.element), -1), list[Floats]()
    for one, other in checked_pairs(mesh, periodic):
        check_outer(triangulation, facets, one, other)
        there, nodes, images = matched(mesh, facets, one, other)
        moved = nodes != images
        for name, v, w, step in (
            (one, nodes[moved], images[moved], there),
            (other, images[moved], nodes[moved], inverse(there)),
        ):
            partner[v], motion[v] = w, len(motions)
            facet_motion[facets.sides[name] > 0] = len(motions)
            motions.append(step)
    return Pairs(partner, motion, np.array(motions).reshape(-1, 2, 3), mates_of(facets, partner), facet_motion)


def image_nodes(mesh: MeshTri, periodic: Sequence[tuple[str, str]]) -> list[tuple[Ints, Ints]]:
    """For every pair of boundaries the nodes of the first, (k,), and those of the second that they are one with, (k,).

    Refuses what `find_pairs` does.
    """
    triangulation = Triangulation.of(mesh)
    facets, found = outline_facets(triangulation), []
    for one, other in checked_pairs(mesh, periodic):
        check_outer(triangulation, facets, one, other)
        found.append(matched(mesh, facets, one, other)[1:])
    return found


def check_outer(triangulation: Triangulation, facets: Facets, *names: str) -> None:
    """Refuse boundaries inside the mesh, which does not go on beyond."""
    inside = triangulation.elements.neighbour[facets.element, facets.corner] >= 0
    for name in names:
        on = facets.sides[name] > 0
        if not on.any() or np.any(on & inside):
            raise ValueError(
                f"periodic boundary {name!r} must lie on the outer boundary of the mesh, all of it; "
                f"{np.count_nonzero(on & inside)} of its {np.count_nonzero(on)} facets are inside."
            )


def matched(mesh: MeshTri, facets: Facets, one: str, other: str) -> tuple[Floats, Ints, Ints]:
    """The motion from one boundary to the other, the nodes of the one, and their partners on the other."""
    nodes, others = (np.unique(facets.nodes[facets.sides[name] > 0]) for name in (one, other))
    if len(nodes) != len(others):
        raise ValueError(
            f"periodic boundaries {one!r} and {other!r} must have as many nodes; they have {len(nodes)} and "
            f"{len(others)}. Mesh them as a pair (Gmsh: Periodic Curve)."
        )
    tree, size = KDTree(mesh.p[:, others].T), np.max(np.ptp(mesh.p, axis=1))
    best, least = None, np.inf
    for motion in candidates(mesh, facets, one, other, nodes, others):
        off, at = tree.query(mesh.p[:, nodes].T @ motion[:, :2].T + motion[:, 2])
        if off.max() < least and len(np.unique(at)) == len(at):
            best, least, images = motion, off.max(), others[at]
    if best is None or least > MATCH * size:
        how_far = "no translation or rotation does" if best is None else f"the nearest is {least:.6g} off"
        raise ValueError(
            f"a translation or rotation must carry the nodes of boundary {one!r} to those of {other!r}, within "
            f"{MATCH:g} of the size of the mesh, and the mesh must go on there; {how_far}. "
            "Mesh them as a pair (Gmsh: Periodic Curve)."
        )
    return best, nodes, images


def candidates(mesh: MeshTri, facets: Facets, one: str, other: str, nodes: Ints, others: Ints) -> list[Floats]:
    """Motions that carry the two ends of one boundary to those of the other, where the mesh goes on."""
    ends, targets = (farthest(mesh.p[:, rows]) for rows in (nodes, others))
    return [
        motion
        for motion in (rigid_motion(ends, targets), rigid_motion(ends, targets[:, ::-1]))
        if goes_on(mesh, facets, one, other, motion)
    ]


def farthest(points: Floats) -> Floats:
    """Two of the points (2, n) that are far from one another, (2, 2): the farthest on a straight boundary."""
    first = np.argmax(np.sum((points - points.mean(axis=1, keepdims=True)) ** 2, axis=0))
    second = np.argmax(np.sum((points - points[:, [first]]) ** 2, axis=0))
    return points[:, [first, second]]


def rigid_motion(points: Floats, targets: Floats) -> Floats:
    """The translation or rotation [A | b] that carries two points (2, 2) to two others as far apart."""
    (ux, uy), (wx, wy) = points[:, 1] - points[:, 0], targets[:, 1] - targets[:, 0]
    cosine, sine = ux * wx + uy * wy, ux * wy - uy * wx
    length = np.hypot(cosine, sine)
    cosine, sine = cosine / length, sine / length
    if abs(sine) < MATCH and cosine > 0.0:
        cosine, sine = 1.0, 0.0
    turn = np.array([[cosine, -sine], [sine, cosine]])
    return np.column_stack([turn, (targets - turn @ points).mean(axis=1)])


def inverse(motion: Floats) -> Floats:
    """The motion back."""
    back = motion[:, :2].T
    return np.column_stack([back, -back @ motion[:, 2]])


def goes_on(mesh: MeshTri, facets: Facets, one: str, other: str, motion: Floats) -> bool:
    """Whether the mesh lies on the other side of the one boundary, once moved, than of the other."""
    normal, across = (outward(mesh, facets, name) for name in (one, other))
    return bool((motion[:, :2] @ normal) @ across < 0.0)


def outward(mesh: MeshTri, facets: Facets, name: str) -> Floats:
    """The direction that a boundary faces on the whole, (2,); its facets run counter-clockwise round their elements."""
    a, b = mesh.p[:, facets.nodes[facets.sides[name] > 0].T].transpose(1, 0, 2)
    x, y = np.sum(b - a, axis=1)
    return np.array([y, -x])


def mates_of(facets: Facets, partner: Ints) -> Ints:
    """For every outline facet the one between the partners of its nodes, -1 where there is none, (f,)."""
    count = len(partner)
    images = partner[facets.nodes].astype(np.int64)
    key = facets.nodes.min(axis=1).astype(np.int64) * count + facets.nodes.max(axis=1)
    wanted = np.where(np.all(images >= 0, axis=1), images.min(axis=1) * count + images.max(axis=1), -1)
    order = np.argsort(key)
    at = np.minimum(np.searchsorted(key[order], wanted), len(key) - 1)
    found = order[at]
    return np.where(key[found] == wanted, found, -1)
