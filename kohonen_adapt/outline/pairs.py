"""Periodic pairs of boundaries, with their motions and matched nodes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import SLIDING, Constraints
from kohonen_adapt.mesh.motions import Motion, Pair, inverse
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.facets import Facets, constrained_facets
from kohonen_adapt.outline.matching import Match, Sides, matched
from kohonen_adapt.outline.rules import checked_pairs

__all__ = ["Pairs", "find_pairs", "image_nodes", "sliding_pairs"]


class Pairs(NamedTuple):
    """Partners of nodes and facets on periodic boundaries."""

    partner: NDArray[np.int32]  # (n,) partner of the node, -1 for none
    motion: NDArray[np.int32]  # (n,) index of the motion onto the partner, -1 for none
    motions: Floats  # (k, 2, 3) motions [A | b], each followed by its inverse
    continues: Mask  # (k,) True if the moved mesh continues the mesh, False if both overlap
    facet: Ints  # (f,) partner of the facet, -1 for none
    facet_motion: Ints  # (f,) index of the motion onto the partner, -1 for none


def find_pairs(triangulation: Triangulation, facets: Facets, periodic: Sequence[Pair]) -> Pairs:
    n = triangulation.nnodes
    partner, motion = np.full(n, -1, dtype=np.int32), np.full(n, -1, dtype=np.int32)
    facet_motion, motions, continues = np.full(len(facets.element), -1), list[Floats](), list[bool]()
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
            continues.append(match.continues)
    partners = np.where(facet_motion >= 0, partner_facets(facets, partner), -1)
    return Pairs(
        partner, motion, np.array(motions).reshape(-1, 2, 3), np.array(continues, bool), partners, facet_motion
    )


def sliding_pairs(constraints: Constraints) -> tuple[Ints, Ints]:
    periodic, slides = constraints.periodic, constraints.kind == SLIDING
    node = np.flatnonzero(slides & (periodic.partner >= 0) & (periodic.motion % 2 == 0) & slides[periodic.partner])
    return node, periodic.partner[node]


def image_nodes(mesh: MeshTri, periodic: Sequence[Pair]) -> list[tuple[Ints, Ints]]:
    triangulation = Triangulation.of(mesh)
    facets = constrained_facets(triangulation)
    matches = [match_of(triangulation, facets, *pair) for pair in checked_pairs(mesh, periodic)]
    return [(match.nodes, match.images) for match in matches]


def match_of(triangulation: Triangulation, facets: Facets, one: str, other: str, named: Motion | None) -> Match:
    check_outer(triangulation, facets, one, other)
    on_one, on_other = (facets.nodes[facets.sides[name] > 0] for name in (one, other))
    position = triangulation.mesh.p
    return matched(Sides((one, other), position, (on_one, on_other), np.max(np.ptp(position, axis=1))), named)


def check_outer(triangulation: Triangulation, facets: Facets, *names: str) -> None:
    inside = triangulation.elements.neighbour[facets.element, facets.corner] >= 0
    for name in names:
        on = facets.sides[name] > 0
        if not on.any() or np.any(on & inside):
            raise ValueError(
                f"periodic boundary {name!r} must lie on the outer boundary of the mesh, all of it; "
                f"{np.count_nonzero(on & inside)} of its {np.count_nonzero(on)} facets are inside."
            )


def partner_facets(facets: Facets, partner: Ints) -> Ints:
    count = len(partner)
    images = partner[facets.nodes].astype(np.int64)
    key = facets.nodes.min(axis=1).astype(np.int64) * count + facets.nodes.max(axis=1)
    wanted = np.where(np.all(images >= 0, axis=1), images.min(axis=1) * count + images.max(axis=1), -1)
    order = np.argsort(key)
    at = np.minimum(np.searchsorted(key[order], wanted), len(key) - 1)
    found = order[at]
    return np.where(key[found] == wanted, found, -1)
