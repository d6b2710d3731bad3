"""Periodic pairs: boundaries that are one another's image, the motions between them, and nodes that are one."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import SLIDING, Constraints
from kohonen_adapt.mesh.motions import Motion, Pair, inverse
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.facets import Facets, outline_facets
from kohonen_adapt.outline.matching import Match, Sides, matched
from kohonen_adapt.outline.rules import checked_pairs

__all__ = ["Pairs", "find_pairs", "image_nodes", "sliding_pairs"]


class Pairs(NamedTuple):
    """Which nodes and outline facets belong together, and how the mesh goes on beyond them; see `Twins`."""

    partner: NDArray[np.int32]  # (n,)
    motion: NDArray[np.int32]  # (n,)
    motions: Floats  # (k, 2, 3), those there and back one after the other
    goes_on: Mask  # (k,) whether the mesh does where a motion carries it; beyond mirrored sides it may not
    facet: Ints  # (f,) the outline facet that is one with this one, -1 for most
    facet_motion: Ints  # (f,) the motion that carries a facet there, -1 likewise


def find_pairs(triangulation: Triangulation, facets: Facets, periodic: Sequence[Pair]) -> Pairs:
    """Find the motion that carries the first boundary of every pair onto the second, unless it is named.

    Refuses what `checked_pairs` and `matched` do.
    """
    n = triangulation.nnodes
    partner, motion = np.full(n, -1, dtype=np.int32), np.full(n, -1, dtype=np.int32)
    facet_motion, motions, goes_on = np.full(len(facets.element), -1), list[Floats](), list[bool]()
    for one, other, named in checked_pairs(triangulation.mesh, periodic):
        match = match_of(triangulation, facets, one, other, named)
        moved = match.nodes != match.images
        nodes, images = match.nodes[moved], match.images[moved]
        for name, v, w, step in (
            (one, nodes, images, match.motion),
            (other, images, nodes, inverse(match.motion)),
        ):
            partner[v], motion[v] = w, len(motions)
            facet_motion[facets.sides[name] > 0] = len(motions)
            motions.append(step)
            goes_on.append(match.goes_on)
    mates = np.where(facet_motion >= 0, mates_of(facets, partner), -1)
    return Pairs(partner, motion, np.array(motions).reshape(-1, 2, 3), np.array(goes_on, bool), mates, facet_motion)


def sliding_pairs(constraints: Constraints) -> tuple[Ints, Ints]:
    """Nodes of the first of every two boundaries, (k,), that slide, and their partners, (k,)."""
    twins, slides = constraints.twins, constraints.kind == SLIDING
    node = np.flatnonzero(slides & (twins.partner >= 0) & (twins.motion % 2 == 0) & slides[twins.partner])
    return node, twins.partner[node]


def image_nodes(mesh: MeshTri, periodic: Sequence[Pair]) -> list[tuple[Ints, Ints]]:
    """For every pair of boundaries the nodes of the first, (k,), and those of the second that they are one with, (k,).

    Refuses what `find_pairs` does.
    """
    triangulation = Triangulation.of(mesh)
    facets = outline_facets(triangulation)
    matches = [match_of(triangulation, facets, *pair) for pair in checked_pairs(mesh, periodic)]
    return [(match.nodes, match.images) for match in matches]


def match_of(triangulation: Triangulation, facets: Facets, one: str, other: str, named: Motion | None) -> Match:
    """The match of two boundaries, which lie on the outer boundary of the mesh."""
    check_outer(triangulation, facets, one, other)
    on_one, on_other = (facets.nodes[facets.sides[name] > 0] for name in (one, other))
    position = triangulation.mesh.p
    return matched(Sides((one, other), position, (on_one, on_other), np.max(np.ptp(position, axis=1))), named)


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
