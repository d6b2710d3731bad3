"""Rules for where the nodes of a mesh may go, and their validation."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from skfem import Mesh, MeshTet, MeshTri

from kohonen_adapt.arrays import Ints, Mask
from kohonen_adapt.checks import is_number, listed, nearest_name
from kohonen_adapt.geometry.plane.curves import Curve, Curves
from kohonen_adapt.geometry.space.surfaces import NamedSurfaces, Surface
from kohonen_adapt.kernels.arrays import UNGUARDED
from kohonen_adapt.mesh.cells import CELLS
from kohonen_adapt.mesh.motions import Motion, Pair
from kohonen_adapt.mesh.names import named_sets

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
    "euclidean_floor_of",
    "floor_of",
    "pinned_nodes",
    "with_pinned",
]

TOPOLOGIES = ("fixed", "flip", "recycle")

LeastQuality = float | Literal["auto"]
Pinned = Sequence[int | str] | Ints | str


@dataclass(frozen=True, eq=False)
class Rules:
    """Constraints on the nodes of a mesh.

    `relocate`, `adapt`, `polish` and `KohonenMap` have keywords with these names. `curves`, `periodic` and `layers` are
    for triangles only, `surfaces` for tetrahedra only.

    Attributes
    ----------
    topology
        ``"fixed"`` keeps the connectivity ``mesh.t``. ``"flip"`` allows edge flips: the map and the smoothing make each
        region constrained Delaunay as far as `min_quality` permits, and the polish (energy descent) flips edges to
        lower the energy. ``"recycle"`` also collapses edges where there are too many nodes, and splits edges where
        there are too few. Then boundaries gain and lose nodes, corners and pinned nodes stay, and the number of
        elements may change.
    min_quality
        Minimum quality of elements, from 0 to below 1. A move, flip, collapse or split is accepted if the worst quality
        of the elements involved is at least ``min(min_quality, worst quality before)`` afterwards. ``"auto"`` means 0.3
        for triangles and 0.2 for tetrahedra, because good tetrahedra alone do not fill space. With a metric, ``"auto"``
        is measured in the metric, above a Euclidean quality of 0.02; numbers stay Euclidean. None disables all checks
        (`KohonenMap` only).
    pinned
        Nodes that stay where they are, as node numbers and names of boundaries and subdomains.
    curves
        Curves of named boundaries, by name: `Line`, `Arc`, `Spline`, or any object with a method ``project(x (2, n)) ->
        (2, n)``. Without a curve, six or more nodes on a circle (within 1e-3 of its radius, with turns of less than 35
        degrees) are recognised as an arc, and four or five nodes if another boundary or interface is an arc about the
        same centre; other turns are corners. Nodes of a circle count together across junctions with other boundaries
        and interfaces, which stay corners, and so do parts of two facets or more across gaps. Pinned corners keep a
        polygon. A spline through points of a circle is treated as the circle.
    periodic
        Pairs of boundary names, as ``[("left", "right")]``, for periodic and antiperiodic conditions. A translation or
        rotation must map the nodes of the first boundary onto the nodes of the second; the moved nodes still match. If
        several motions do so, as between circles, the third entry of a pair selects one: a `Rotation` (in radians),
        `Translation` or `Reflection`, as in ``("rotor", "bore", ka.Rotation(0.1))``. Reflections are never guessed.
        Nodes of pairs slide with the map, and stay in the polish. The density recycles them on both sides, the energy
        does not.
    layers
        Numbers of element layers to preserve across thin subdomains, by name: every path along edges from one side to
        the other then has at least so many edges. The sides are the parts of the subdomain's boundary that face each
        other at a short distance, with the parts that connect parts of one side; the ends of a gap belong to no side.
        Missing layers are made by splitting edges across the subdomain, with ``"recycle"`` (which removes nodes
        elsewhere) or, in `adapt`, with `target_nodes`. Otherwise missing layers raise ValueError.
    surfaces
        Surfaces of named boundaries of tetrahedra, by name: `Plane`, `Sphere`, `Cylinder`, `Cone`, or any object with a
        method ``project(x (3, n)) -> (3, n)``. Nodes slide on a surface, or on the intersection of two, and new nodes
        are put there. An object with `project` is sampled in and near 15 points on every face of the start mesh and
        replaced by paraboloids there while nodes move; at the end every node is projected. Without a surface, faces
        with turns of less than 35 degrees are recognised as a cylinder (ten nodes within 1e-3 of its radius, at six
        angles around its axis; or fewer, at four angles, if another cylinder has the same axis) or as a sphere, even
        where these continue smoothly into planes or each other. Plane strips with turns up to 41 degrees, all of whose
        nodes have one distance from the axis of such a cylinder, are a cylinder, too. All other faces are planes.

    Raises
    ------
    ValueError
        If a value has the wrong type or is out of range. Values that depend on the mesh are checked when the rules are
        applied to a mesh.
    """

    topology: str = "flip"
    min_quality: LeastQuality | None = "auto"
    pinned: Pinned = ()
    curves: Curves | None = None
    periodic: Sequence[Pair] = ()
    layers: Mapping[str, int] | None = None
    surfaces: NamedSurfaces | None = None

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
            if isinstance(getattr(self, name), Iterator):  # every pass reads the entries, not just the first
                object.__setattr__(self, name, tuple(getattr(self, name)))

    @property
    def flips(self) -> bool:
        """True if edges may flip."""
        return self.topology != "fixed"

    def guarded(self) -> "Rules":
        """Return these rules if they have a minimum quality.

        Raises
        ------
        ValueError
            If `min_quality` is None.
        """
        if self.min_quality is None:
            raise ValueError("min_quality must be 'auto' or a number here; only KohonenMap works unchecked. Got None.")
        return self


EUCLIDEAN_FLOOR = 0.02  # beside a metric, in which min_quality="auto" is measured


def is_least_quality(value: object) -> bool:
    if isinstance(value, str):
        return value == "auto"
    return value is None or (is_number(value) and bool(0 <= value < 1))  # type: ignore[operator]


def floor_of(rules: Rules, dimension: int) -> float:
    if rules.min_quality is None:
        return UNGUARDED
    return float(CELLS[dimension].floor if rules.min_quality == "auto" else rules.min_quality)


def euclidean_floor_of(rules: Rules, dimension: int) -> float:
    # beside a metric
    return EUCLIDEAN_FLOOR if rules.min_quality == "auto" else floor_of(rules, dimension)


def check_for(rules: Rules, dimension: int) -> None:
    if dimension == 2 and rules.surfaces:
        raise ValueError("surfaces are for tetrahedra; a boundary in the plane may be given one of the curves.")
    if dimension == 3 and rules.curves:
        raise ValueError("curves are for triangles; a boundary of tetrahedra may be given one of the surfaces.")
    for name in ("periodic", "layers"):
        if dimension == 3 and len(getattr(rules, name) or ()):
            raise ValueError(f"{name} must be left out for tetrahedra; it is for triangles only.")


def with_pinned(rules: Rules, nodes: Sequence[int]) -> Rules:
    given = [rules.pinned] if isinstance(rules.pinned, str) else rules.pinned
    return replace(rules, pinned=[*given, *nodes]) if nodes else rules


def pinned_nodes(mesh: Mesh, pinned: Pinned) -> Mask:
    mask = np.zeros(mesh.p.shape[1], bool)
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
    boundaries, subdomains = mesh.boundaries or {}, mesh.subdomains or {}
    if name in boundaries and name in subdomains:
        raise ValueError(f"pinned name {name!r} is both a boundary and a subdomain; rename one of them.")
    if name in boundaries:
        return mesh.facets[:, np.asarray(boundaries[name])]
    if name in subdomains:
        return mesh.t[:, subdomains[name]]
    known = {*boundaries, *subdomains}
    raise ValueError(
        f"pinned name {name!r} is not in the mesh; its boundaries and subdomains are: {listed(known)}."
        f"{nearest_name(name, known)}"
    )


def checked_curves(mesh: MeshTri, curves: Curves | None) -> dict[str, Curve]:
    return checked_shapes(mesh, curves, "curve", "kohonen_adapt.Line, Arc or Spline", 2)


def checked_surfaces(mesh: MeshTet, surfaces: NamedSurfaces | None) -> dict[str, Surface]:
    return checked_shapes(mesh, surfaces, "surface", "kohonen_adapt.Plane, Sphere, Cylinder or Cone", 3)


def checked_shapes(mesh: Mesh, shapes: Curves | None, kind: str, known: str, d: int) -> dict[str, Curve]:
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
    if layers is None:
        return {}
    if not isinstance(layers, Mapping):
        raise ValueError(f"layers must map names of subdomains to numbers of layers; got {type(layers).__name__}.")
    names = named_sets(mesh.subdomains)
    for name, number in layers.items():
        if name not in names:
            raise ValueError(
                f"layers has {name!r}, which is no subdomain of the mesh; its subdomains are: {listed(names)}."
                f"{nearest_name(name, names)}"
            )
        if not isinstance(number, int | np.integer) or isinstance(number, bool) or number < 1:
            raise ValueError(f"layers of subdomain {name!r} must be an integer >= 1; got {number!r}.")
    return {name: int(number) for name, number in layers.items()}


def check_boundary(mesh: Mesh, name: str, argument: str) -> None:
    known = mesh.boundaries or {}
    if not isinstance(name, str) or name not in known:
        raise ValueError(
            f"{argument} has {name!r}, which is no boundary of the mesh; its boundaries are: {listed(known)}."
            f"{nearest_name(name, known)}"
        )
