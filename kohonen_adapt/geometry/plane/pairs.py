"""Periodic pairs of boundaries, their motions and their matched nodes."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Int32s, Ints, IntsPair, Mask
from kohonen_adapt.checks import point_text
from kohonen_adapt.geometry.plane.cutting import Points, as_complex, as_rows, square
from kohonen_adapt.geometry.plane.polylines import Facets, constrained_facets
from kohonen_adapt.geometry.rules import checked_pairs
from kohonen_adapt.kernels.triangle.arrays import SLIDING, Constraints
from kohonen_adapt.mesh.host import ascending, keys_of
from kohonen_adapt.mesh.motions import Motion, Pair, inverse, is_proper, motion_of, moved
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["Match", "Pairs", "Sides", "Unmatched", "find_pairs", "image_nodes", "matched", "sliding_pairs"]

MATCH = 1e-8  # maximum distance of a paired node from its partner's image, relative to the size of the mesh
PROBES = 8  # number of nodes that are tried first if many motions are to be tried
SHOWN = 3  # maximum number of motions that are proposed
ENOUGH = 16  # number of fitting motions after which none is expected to continue the mesh
MIRROR = np.diag([-1.0, 1.0])


class Unmatched(ValueError):
    pass


class Sides(NamedTuple):
    names: tuple[str, str]
    position: Floats  # (2, n)
    facets: IntsPair  # (k, 2) each: nodes, counter-clockwise around the elements
    size: float  # largest extent of the mesh

    @property
    def nodes(self) -> IntsPair:
        one, other = (np.unique(facets) for facets in self.facets)
        return one, other

    @property
    def near(self) -> float:
        return MATCH * self.size

    def sentence(self, verb: str) -> str:
        return f"periodic boundaries {self.names[0]!r} and {self.names[1]!r} {verb}"


class Match(NamedTuple):
    motion: Floats  # [A | b]
    nodes: Ints  # (k,) nodes of the first boundary
    images: Ints  # (k,) nodes of the second boundary, nearest to the images of the first
    distance: float  # largest distance between `images` and the images of `nodes`
    fits: bool  # True if the distance is small
    continues: bool  # True if the moved mesh lies on the other side of the second boundary
    fault: str  # why a motion that matches nodes is not suitable; empty if suitable

    @property
    def is_suitable(self) -> bool:
        return self.fits and self.continues and not self.fault


def matched(sides: Sides, named: Motion | None) -> Match:
    """Return the match by the motion `named`, or by the only suitable motion.

    A suitable motion is a translation or rotation that maps nodes to nodes and facets to facets, and the mesh to the
    other side of the second boundary. Raises ValueError if several are suitable or none is.
    """
    one, other = (len(nodes) for nodes in sides.nodes)
    if one != other:
        raise ValueError(
            f"{sides.sentence('must have as many nodes')}; they have {one} and {other}. Mesh them as a pair (Gmsh: "
            "Periodic Curve)."
        )
    if named is None:
        return only_suitable(sides)
    match = match_by(sides, named.matrix)
    if not match.fits:
        raise Unmatched(unmatched_message(sides, repr(named), f"it leaves one {match.distance:.6g} off"))
    if match.fault:
        raise ValueError(f"{sides.sentence('do not fit')} by {named!r}: {match.fault}")
    return match


def only_suitable(sides: Sides) -> Match:
    tried = first_matches(matches_by_angle(sides, mirrored=False))
    suitable = [match for match in tried if match.is_suitable]
    if len(suitable) == 1:
        return suitable[0]
    if suitable:
        raise ValueError(
            f"{sides.sentence('fit')} by more than one motion, and each gives another field. "
            f"{proposal(sides, motions_of(sides, suitable))}"
        )
    raise refusal(sides, tried)


def first_matches(matches: Iterator[Match]) -> list[Match]:
    found = list[Match]()
    for match in matches:
        found.append(match)
        fitting = [each for each in found if each.fits and not each.fault]
        if len(fitting) == ENOUGH or sum(each.continues for each in fitting) == SHOWN:
            break
    return found


def refusal(sides: Sides, tried: Sequence[Match]) -> ValueError:
    fitting = [match for match in tried if match.distance <= sides.near]
    overlapping = motions_of(sides, fitting)
    reflections = motions_of(
        sides, [match for match in matches_by_angle(sides, mirrored=True) if match.distance <= sides.near]
    )
    if overlapping:
        return ValueError(
            f"{sides.sentence('fit')} by a motion, but the mesh does not go on there: once moved it lies on the same "
            f"side of {sides.names[1]!r}. The two may be one nevertheless, as those of a disc and its Kelvin disc are. "
            f"{proposal(sides, [*reflections[:1], *overlapping[:1]])}"
        )
    if fitting:
        return ValueError(f"{sides.sentence('do not fit')}: {fitting[0].fault}")
    if reflections:
        return ValueError(
            f"{sides.sentence('fit')} by a reflection, which is not guessed. {proposal(sides, reflections)}"
        )
    least = min(match.distance for match in tried)
    return Unmatched(unmatched_message(sides, "a translation or rotation", f"the nearest is {least:.6g} off"))


def unmatched_message(sides: Sides, motion: str, found: str) -> str:
    one, other = sides.names
    return (
        f"{motion} must carry the nodes of boundary {one!r} to those of {other!r}, within {MATCH:g} of the size of the "
        f"mesh; {found}. Mesh them as a pair (Gmsh: Periodic Curve)."
    )


def motions_of(sides: Sides, matches: Sequence[Match]) -> list[Motion]:
    fitting = (match.motion for match in matches if match.fits and not match.fault)
    return [found for motion in fitting if (found := motion_of(motion, sides.size))]


def proposal(sides: Sides, motions: Sequence[Motion]) -> str:
    first, *others = (f"kohonen_adapt.{motion!r}" for motion in motions)
    rest = "".join(f", or {motion}" for motion in others)
    kind, (one, other) = type(motions[0]).__name__.lower(), sides.names
    keys = ", ".join(f"{key} = {list(x) if isinstance(x, tuple) else x}" for key, x in vars(motions[0]).items())
    return (
        f"Name the motion that is meant as the third entry of the pair, for instance ({one!r}, {other!r}, {first})"
        f'{rest}; in a case ["{one}", "{other}", {{motion = "{kind}", {keys}}}].'
    )


def matches_by_angle(sides: Sides, mirrored: bool) -> Iterator[Match]:
    motions = candidates(sides, mirrored)
    if mirrored:
        motions = [motion for motion in motions if motion_of(motion, sides.size)] or motions[:1]
    nodes, others = sides.nodes
    tree = KDTree(sides.position[:, others].T)
    probes = sides.position[:, nodes[:: max(1, len(nodes) // PROBES)]]
    distance = np.array([tree.query(moved(motion, probes).T)[0].max() for motion in motions])
    near_matches = np.flatnonzero(distance <= max(sides.near, distance.min()))
    angle = np.abs([np.arctan2(motions[k][1, 0], motions[k][0, 0]) for k in near_matches])
    for k in near_matches[np.argsort(np.round(angle, 9), kind="stable")]:
        yield match_by(sides, motions[k])


def candidates(sides: Sides, mirrored: bool) -> list[Floats]:
    points, targets = (as_complex(sides.position[:, nodes].T) for nodes in sides.nodes)
    ends = farthest(-points.conj() if mirrored else points)
    radius = np.abs(targets - targets.mean())
    slack = 4.0 * sides.near
    middle = -points.mean().conj() if mirrored else points.mean()
    first, second = (np.flatnonzero(np.abs(radius - r) <= slack) for r in np.abs(ends - middle))
    apart, aims = np.abs(ends[1] - ends[0]), list[Points]()
    for q in first:
        distance = np.abs(targets[second] - targets[q]) - apart
        aims += [targets[[q, w]] for w in second[np.abs(distance) <= slack]]
    aims = aims or [farthest(targets), farthest(targets)[::-1]]
    found = [rigid_motion(ends, aim) for aim in aims]
    return [np.column_stack([each[:, :2] @ MIRROR, each[:, 2]]) for each in found] if mirrored else found


def match_by(sides: Sides, motion: Floats) -> Match:
    nodes, others = sides.nodes
    distance, at = KDTree(sides.position[:, others].T).query(moved(motion, sides.position[:, nodes]).T)
    images, (one, other) = others[at], sides.names
    against, along = senses(sides, nodes, images)
    fault = ""
    if len(np.unique(at)) < len(at):
        twice = at[np.setdiff1d(np.arange(len(at)), np.unique(at, return_index=True)[1])[0]]
        fault = (
            f"two nodes of {one!r} come to lie on one of {other!r}, at {point_text(sides.position[:, others[twice]])}. "
            "Merge nodes that are in one place, or name the two sides of a slit apart."
        )
    elif not np.all(against | along) or len(sides.facets[0]) != len(sides.facets[1]):
        fault = (
            f"the nodes of {one!r} come to lie on those of {other!r}, but not all facets on facets: of "
            f"{len(against)} {np.sum(against | along)} do, of {len(sides.facets[1])}. Name all facets on both sides."
        )
    elif not (against.all() or along.all()):
        fault = (
            f"the mesh goes on beyond {np.sum(against)} facets of {other!r} and lies on the same side of "
            f"{np.sum(along)}. Name parts apart that are one another's image by different motions."
        )
    largest = float(distance.max())
    continues = bool(against.all()) == is_proper(motion)
    return Match(motion, nodes, images, largest, largest <= sides.near, continues, fault)


def senses(sides: Sides, nodes: Ints, images: Ints) -> tuple[Mask, Mask]:
    count = sides.position.shape[1]
    image = np.full(count, -1, np.int64)
    image[nodes] = images
    first = image[sides.facets[0].T]
    second = sides.facets[1].T
    against, along = (np.isin(keys_of(ends, count), keys_of(second, count)) for ends in (first[::-1], first))
    return against, along


def farthest(points: Points) -> Points:
    first = points[np.argmax(square(points - points.mean()))]
    return np.array([first, points[np.argmax(square(points - first))]])


def rigid_motion(points: Points, targets: Points) -> Floats:
    turn = (points[1] - points[0]).conj() * (targets[1] - targets[0])
    cosine, sine = as_rows(turn) / np.abs(turn)
    if abs(sine) < MATCH and cosine > 0.0:
        cosine, sine = 1.0, 0.0
    matrix = np.array([[cosine, -sine], [sine, cosine]])
    return np.column_stack([matrix, np.mean(as_rows(targets) - as_rows(points) @ matrix.T, axis=0)])


class Pairs(NamedTuple):
    partner: Int32s  # (n,) partner of the node, -1 for none
    motion: Int32s  # (n,) index of the motion onto the partner, -1 for none
    motions: Floats  # (k, 2, 3) motions [A | b], each followed by its inverse
    facet: Ints  # (f,) partner of the facet, -1 for none
    facet_motion: Ints  # (f,) index of the motion onto the partner, -1 for none


def find_pairs(triangulation: Triangulation, facets: Facets, periodic: Sequence[Pair]) -> Pairs:
    n = triangulation.nnodes
    partner, motion = np.full(n, -1, np.int32), np.full(n, -1, np.int32)
    facet_motion, motions = np.full(len(facets.element), -1), list[Floats]()
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
    partners = np.where(facet_motion >= 0, partner_facets(facets, partner), -1)
    return Pairs(partner, motion, np.array(motions).reshape(-1, 2, 3), partners, facet_motion)


def sliding_pairs(constraints: Constraints) -> IntsPair:
    periodic = constraints.periodic
    slides = constraints.kind == SLIDING
    node = np.flatnonzero(slides & (periodic.partner >= 0) & (periodic.motion % 2 == 0) & slides[periodic.partner])
    return node, periodic.partner[node]


def image_nodes(mesh: MeshTri, periodic: Sequence[Pair]) -> list[IntsPair]:
    triangulation = Triangulation.of(mesh)
    facets = constrained_facets(triangulation.mesh, triangulation.elements)
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
    images = partner[facets.nodes.T]
    count = len(partner)
    key, wanted = (keys_of(ascending(*ends), count) for ends in (facets.nodes.T, np.maximum(images, 0)))
    order = np.argsort(key)
    found = order[np.minimum(np.searchsorted(key[order], wanted), len(key) - 1)]
    return np.where((key[found] == wanted) & np.all(images >= 0, axis=0), found, -1)
