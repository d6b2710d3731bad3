"""Say what the nodes of a mesh may do, and check it: alone, and against the names of a mesh."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from skfem import Mesh, MeshTet, MeshTri

from kohonen_adapt.arrays import Ints, Mask
from kohonen_adapt.checks import is_number, listed
from kohonen_adapt.kernels.arrays import UNGUARDED
from kohonen_adapt.mesh.cells import CELLS
from kohonen_adapt.mesh.motions import Motion, Pair
from kohonen_adapt.mesh.names import named_sets
from kohonen_adapt.outline.curves import Curve
from kohonen_adapt.outline.surfaces import Surface

__all__ = [
    "TOPOLOGIES",
    "LeastQuality",
    "Pinned",
    "Rules",
    "check_for",
    "checked_curves",
    "checked_layers",
    "checked_pair",
    "checked_pairs",
    "checked_surfaces",
    "floor_of",
    "holding",
    "pinned_nodes",
]

TOPOLOGIES = ("fixed", "flip", "recycle")

LeastQuality = float | Literal["auto"]
Pinned = Sequence[int | str] | Ints | str


@dataclass(frozen=True, eq=False)
class Rules:
    """What the nodes of a mesh may do; the keywords of `relocate`, `adapt`, `polish` and `KohonenMap` have these names.

    Attributes
    ----------
    topology
        ``"fixed"`` keeps the connectivity ``mesh.t``; ``"flip"`` flips edges: map and smoothing make each region
        constrained Delaunay as far as `min_quality` lets them, the polish lowers the energy; ``"recycle"`` also takes
        nodes away where there are too many and puts as many where there are too few: outlines gain and lose nodes,
        corners and pinned nodes stay, and the number of elements may change.
    min_quality
        A move, flip, collapse or split is accepted if the worst quality it leaves in what it touches is at least
        ``min(min_quality, the worst there before)``; from 0 to below 1. ``"auto"`` means 0.3 for triangles and 0.2 for
        tetrahedra, which do not fill space by good ones alone. None switches every check off (`KohonenMap` only).
    pinned
        What stays where it is: node numbers, names of boundaries and subdomains.
    curves
        The curves that named boundaries are on: `Line`, `Arc`, `Spline`, or any object with a method
        ``project(x (2, n)) -> (2, n)``, by name. Without one, six nodes and more on a circle (within 1e-3 of its
        radius, turning by less than 35 degrees at each) are taken for an arc, four and five where another outline is
        an arc about the same centre, and other turns for corners. A spline through points of a circle is that circle.
    periodic
        Pairs of names of boundaries, as ``[("left", "right")]``, for periodic and antiperiodic conditions: a
        translation or rotation carries the one to the other node by node, and does so afterwards. Where several would,
        as between circles, the third entry of a pair names the one that is meant, a `Rotation` (radians),
        `Translation` or `Reflection`: ``("rotor", "bore", ka.Rotation(0.1))``. Reflections are never guessed. A
        training point beside one boundary also reaches what lies beside the other, where the mesh goes on there. Such
        nodes slide with the map; they are neither polished nor recycled.
    layers
        Layers of elements to keep across thin subdomains, by name: every way over edges from one side to the other then
        has so many edges or more. The sides are the pieces of the subdomain's outline that face each other at a short
        distance, with whatever joins pieces of one side; the ends of a gap are none. Where there are fewer, edges
        across are halved with ``"recycle"``, which takes nodes elsewhere for it, and in `adapt` with `target_nodes`;
        without either it is refused.
    surfaces
        Of tetrahedra, the surfaces that named boundaries are on: `Plane`, `Sphere`, `Cylinder`, `Cone`, or any object
        with a method ``project(x (3, n)) -> (3, n)``, by name. Nodes slide on them, where two meet on both, and new
        ones are put there. An object with `project` is asked for 15 points on every face of the start mesh, and for
        what is near them: loops take it for paraboloids there. In the end every node is projected.
        Without any, faces that turn by less than 35 degrees are taken for a cylinder (ten nodes within 1e-3 of its
        radius, at six places around its axis, or fewer, at four places, where another cylinder has the same axis) or
        for a sphere, also where those go on smoothly into planes or into one another; all others for planes.

    `curves`, `periodic` and `layers` are for triangles only, and `surfaces` for tetrahedra only.

    Raises
    ------
    ValueError
        If one of them is of another kind or out of range. What depends on the mesh is refused when it is met.
    """

    topology: str = "flip"
    min_quality: LeastQuality | None = "auto"
    pinned: Pinned = ()
    curves: Mapping[str, Curve] | None = None
    periodic: Sequence[Pair] = ()
    layers: Mapping[str, int] | None = None
    surfaces: Mapping[str, Surface] | None = None

    def __post_init__(self) -> None:
        if self.topology not in TOPOLOGIES:
            raise ValueError(f"topology must be 'fixed', 'flip' or 'recycle'; got {self.topology!r}.")
        if not is_least_quality(self.min_quality):
            raise ValueError(f"min_quality must be 'auto' or from 0 to below 1; got {self.min_quality!r}.")
        if not isinstance(self.pinned, Iterable) or (isinstance(self.pinned, np.ndarray) and self.pinned.ndim == 0):
            raise ValueError(f"pinned must be a sequence of node numbers and names; got {self.pinned!r}.")
        if not isinstance(self.periodic, Iterable) or isinstance(self.periodic, str):
            raise ValueError(
                f"periodic must hold pairs of names of boundaries, as [('left', 'right')]; got {self.periodic!r}."
            )
        for name in ("pinned", "periodic"):
            if isinstance(getattr(self, name), Iterator):  # every pass goes through them again
                object.__setattr__(self, name, tuple(getattr(self, name)))

    @property
    def flips(self) -> bool:
        """Whether edges may flip."""
        return self.topology != "fixed"

    def guarded(self) -> "Rules":
        """These rules, refused where they have no quality to keep.

        Raises
        ------
        ValueError
            If `min_quality` is None.
        """
        if self.min_quality is None:
            raise ValueError("min_quality must be 'auto' or a number here; only KohonenMap works unchecked. Got None.")
        return self


def is_least_quality(value: object) -> bool:
    """Whether it is a least quality, "auto" or none."""
    if isinstance(value, str):
        return value == "auto"
    return value is None or (is_number(value) and bool(0 <= value < 1))  # type: ignore[operator]


def floor_of(rules: Rules, dimension: int) -> float:
    """The least quality that elements in so many dimensions are to keep; UNGUARDED where nothing is checked."""
    if rules.min_quality is None:
        return UNGUARDED
    return float(CELLS[dimension].floor if rules.min_quality == "auto" else rules.min_quality)


def check_for(rules: Rules, dimension: int) -> None:
    """Refuse what is for elements in another number of dimensions."""
    if dimension == 2 and rules.surfaces:
        raise ValueError("surfaces are for tetrahedra; a boundary in the plane may be given one of the curves.")
    if dimension == 3 and rules.curves:
        raise ValueError("curves are for triangles; a boundary of tetrahedra may be given one of the surfaces.")
    for name in ("periodic", "layers"):
        if dimension == 3 and len(getattr(rules, name) or ()):
            raise ValueError(f"{name} must be left out for tetrahedra; it is for triangles only.")


def holding(rules: Rules, nodes: Sequence[int]) -> Rules:
    """The rules with more nodes pinned."""
    given = [rules.pinned] if isinstance(rules.pinned, str) else rules.pinned
    return replace(rules, pinned=[*given, *nodes]) if nodes else rules


def pinned_nodes(mesh: Mesh, pinned: Pinned) -> Mask:
    """Mask (nodes,) of the nodes meant by node numbers and names of boundaries and subdomains.

    Refuses unknown names and those of both a boundary and a subdomain, numbers out of range, and whatever is neither.
    """
    mask = np.zeros(mesh.p.shape[1], dtype=bool)
    for entry in [pinned] if isinstance(pinned, str) else pinned:
        if isinstance(entry, str):
            mask[nodes_of_name(mesh, entry)] = True
        elif isinstance(entry, int | np.integer) and not isinstance(entry, bool):
            if not 0 <= entry < len(mask):
                raise ValueError(f"pinned nodes must be from 0 to {len(mask) - 1}; got {entry}.")
            mask[entry] = True
        else:
            raise ValueError(f"pinned must hold node numbers and names; got {entry!r}.")
    return mask


def nodes_of_name(mesh: Mesh, name: str) -> Ints:
    """The nodes of a named boundary or subdomain."""
    boundaries, subdomains = mesh.boundaries or {}, mesh.subdomains or {}
    if name in boundaries and name in subdomains:
        raise ValueError(f"pinned name {name!r} is both a boundary and a subdomain; rename one of them.")
    if name in boundaries:
        return mesh.facets[:, np.asarray(boundaries[name])]
    if name in subdomains:
        return mesh.t[:, subdomains[name]]
    known = listed({*boundaries, *subdomains})
    raise ValueError(f"pinned name {name!r} is not in the mesh; its boundaries and subdomains are: {known}.")


def checked_curves(mesh: MeshTri, curves: Mapping[str, Curve] | None) -> dict[str, Curve]:
    """The curves given for boundaries of a mesh; refused without a mapping, a boundary or a method `project`."""
    return checked_shapes(mesh, curves, "curve", "kohonen_adapt.Line, Arc or Spline", 2)


def checked_surfaces(mesh: MeshTet, surfaces: Mapping[str, Surface] | None) -> dict[str, Surface]:
    """The surfaces given for boundaries of a mesh; refused without a mapping, a boundary or a method `project`."""
    return checked_shapes(mesh, surfaces, "surface", "kohonen_adapt.Plane, Sphere, Cylinder or Cone", 3)


def checked_shapes(mesh: Mesh, shapes: Mapping[str, Curve] | None, kind: str, known: str, d: int) -> dict[str, Curve]:
    """What boundaries of a mesh in d dimensions are given by a rule, each of which is one of a `kind`."""
    if shapes is None:
        return {}
    if not isinstance(shapes, Mapping):
        raise ValueError(f"{kind}s must map names of boundaries to {kind}s; got {type(shapes).__name__}.")
    for name, shape in shapes.items():
        check_boundary(mesh, name, f"{kind}s")
        if not callable(getattr(shape, "project", None)):
            raise ValueError(
                f"the {kind} of boundary {name!r} must be a {known}, or have a method "
                f"project(x ({d}, n)) -> ({d}, n); got {shape!r}."
            )
    return dict(shapes)


def checked_pairs(mesh: MeshTri, periodic: Sequence[Pair]) -> list[tuple[str, str, Motion | None]]:
    """Names of paired boundaries and the motion between them, None where it is not named.

    Refused where an entry is no pair, or a name that of no boundary or there twice.
    """
    found, seen = list[tuple[str, str, Motion | None]](), set[str]()
    for pair in periodic:
        one, other, motion = checked_pair(pair, "periodic")
        for name in (one, other):
            check_boundary(mesh, name, "periodic")
            if name in seen:
                raise ValueError(f"boundary {name!r} is in periodic twice; it can have one partner only.")
            seen.add(name)
        found.append((one, other, motion))
    return found


def checked_pair(pair: Any, argument: str) -> tuple[str, str, Motion | None]:
    """The two names and the motion, if any, of an entry of an argument."""
    if not isinstance(pair, tuple | list) or len(pair) not in (2, 3):
        raise ValueError(f"{argument} must hold pairs of names of boundaries, as [('left', 'right')]; got {pair!r}.")
    one, other, motion = (*pair, None)[:3]
    if not isinstance(motion, Motion | None):
        raise ValueError(
            f"the third entry of a pair in {argument} must be a kohonen_adapt.Rotation, Translation or Reflection; got "
            f"{motion!r}."
        )
    return one, other, motion


def checked_layers(mesh: MeshTri, layers: Mapping[str, int] | None) -> dict[str, int]:
    """How many layers each subdomain is to have; refused without a mapping, a subdomain or an integer >= 1."""
    if layers is None:
        return {}
    if not isinstance(layers, Mapping):
        raise ValueError(f"layers must map names of subdomains to numbers of layers; got {type(layers).__name__}.")
    names = named_sets(mesh.subdomains)
    for name, number in layers.items():
        if name not in names:
            raise ValueError(
                f"layers has {name!r}, which is no subdomain of the mesh; its subdomains are: {listed(names)}."
            )
        if not isinstance(number, int | np.integer) or isinstance(number, bool) or number < 1:
            raise ValueError(f"layers of subdomain {name!r} must be an integer >= 1; got {number!r}.")
    return {name: int(number) for name, number in layers.items()}


def check_boundary(mesh: Mesh, name: str, argument: str) -> None:
    """Refuse a name in an argument that is not that of a boundary."""
    known = mesh.boundaries or {}
    if not isinstance(name, str) or name not in known:
        raise ValueError(
            f"{argument} has {name!r}, which is no boundary of the mesh; its boundaries are: {listed(known)}."
        )
