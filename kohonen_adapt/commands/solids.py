"""Describe what only a mesh of tetrahedra has: dihedral angles, and surfaces, with what its nodes may do there."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.display import counted
from kohonen_adapt.kernels.tetrahedron.arrays import CONE, CYLINDER, HELD, INSIDE, ON_PATCH, ON_RIDGE, PLANE, SPHERE
from kohonen_adapt.mesh.measures import hat_gradients
from kohonen_adapt.outline.movable_solid import MovableSolid

__all__ = ["angles_described", "doubtful_patches", "facets_described", "surfaces_described"]

SHAPES = {PLANE: "plane", SPHERE: "sphere", CYLINDER: "cylinder", CONE: "cone"}
SMALL = 2  # faces of a patch: a curved surface that nothing was recognised as is all such patches
MANY = 12  # of them: fewer are corners of a drawing
NAMED = 3  # names that are told


def facets_described(mesh: MeshTet, rows: Ints) -> str:
    """The area of facets, and how many are inside."""
    a, b, c = (mesh.p[:, corner] for corner in mesh.facets[:, rows])
    total = 0.5 * np.linalg.norm(np.cross(b - a, c - a, axis=0), axis=0).sum()
    inside = int(np.sum(mesh.f2t[1, rows] >= 0))
    return f", {total:.4g} m^2{f', {inside} of them inside' if inside else ''}"


def angles_described(mesh: MeshTet) -> str:
    """A line about the angles between faces of elements."""
    unit = hat_gradients(mesh)
    unit /= np.linalg.norm(unit, axis=0)
    cosine = [-np.sum(unit[:, i] * unit[:, j], axis=0) for i, j in combinations(range(4), 2)]
    low, high = np.degrees(np.arccos(np.clip([np.max(cosine), np.min(cosine)], -1.0, 1.0)))
    return f"dihedral angles: from {low:.3g} to {high:.3g} degrees"


def surfaces_described(movable: MovableSolid) -> list[str]:
    """Lines about the patches of a mesh by shape, and about what its nodes may do."""
    surfaces, number = movable.surfaces, movable.freedom.number
    shapes = [_counted_shape(surfaces.size[surfaces.shape == shape], said) for shape, said in SHAPES.items()]
    inside, faces, ridges, held = (np.sum(number == kind) for kind in (INSIDE, ON_PATCH, ON_RIDGE, HELD))
    return [
        f"surfaces: {counted(len(surfaces.shape), 'patch')}, {', '.join(filter(None, shapes)) or 'none known'}, "
        f"{counted(len(surfaces.ridge_shape), 'ridge')}",
        f"nodes: {inside} free, {faces} slide on surfaces, {ridges} along ridges, {held} held for good",
    ]


def _counted_shape(sizes: Floats, what: str) -> str:
    """How many patches have a shape, with their radii."""
    if not len(sizes):
        return ""
    radii = list(dict.fromkeys(f"{size:.4g}" for size in np.sort(sizes))) if what in ("sphere", "cylinder") else []
    return counted(len(sizes), what) + (f" (radius {', '.join(radii)} m)" if radii else "")


def doubtful_patches(movable: MovableSolid) -> Iterator[str]:
    """A sentence about faces that may be on a curved surface, where that is not known."""
    tet = movable.tetrahedralization
    patch, across = tet.elements.patch[tet.used], tet.elements.neighbour[tet.used]
    share = np.where(across < 0, 1.0, 0.5)  # a face inside is one of two elements
    faces = np.bincount(patch[patch >= 0], share[patch >= 0], minlength=len(movable.surfaces.shape))
    small = (movable.surfaces.shape == PLANE) & (faces <= SMALL)
    if np.sum(small) >= MANY:
        names = [f"'{name}'" for name, manner in movable.patches.names.items() if np.any(manner[small] != 0)]
        more = ", ..." if len(names) > NAMED else ""
        where = f" in {', '.join(names[:NAMED])}{more}" if names else ""
        yield (
            f"{np.sum(small)} patches of one face or two{where}: their nodes stay where they are. If that is a curved "
            'surface, say so: surfaces={"NAME": ka.Cylinder(point, axis, radius)}, or ka.Sphere, ka.Cone; here the '
            "option --surfaces."
        )
