"""Description of the angles and surfaces of tetrahedral meshes."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.display import counted
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.tetrahedron.arrays import CONE, CYLINDER, HELD, INSIDE, ON_PATCH, ON_RIDGE, PLANE, SPHERE
from kohonen_adapt.mesh.measures import hat_gradients

__all__ = ["angles_described", "doubtful_patches", "facets_described", "surfaces_described"]

SHAPES = {PLANE: "plane", SPHERE: "sphere", CYLINDER: "cylinder", CONE: "cone"}
SMALL = 2  # faces per patch of a curved surface that was not recognised
MANY = 12  # patches of this size; fewer may be details of a plane drawing
NAMED = 3  # names listed


def facets_described(mesh: MeshTet, rows: Ints) -> str:
    a, b, c = (mesh.p[:, corner] for corner in mesh.facets[:, rows])
    total = 0.5 * np.linalg.norm(np.cross(b - a, c - a, axis=0), axis=0).sum()
    inside = int(np.sum(mesh.f2t[1, rows] >= 0))
    return f", {total:.4g} m^2{f', {inside} of them inside' if inside else ''}"


def angles_described(mesh: MeshTet) -> str:
    unit = hat_gradients(mesh)
    unit /= np.linalg.norm(unit, axis=0)
    cosine = [-np.sum(unit[:, i] * unit[:, j], axis=0) for i, j in combinations(range(4), 2)]
    low, high = np.degrees(np.arccos(np.clip([np.max(cosine), np.min(cosine)], -1.0, 1.0)))
    return f"dihedral angles: from {low:.3g} to {high:.3g} degrees"


def surfaces_described(movable: MovableSolid) -> list[str]:
    surfaces, number = movable.surfaces, movable.freedom.number
    shapes = [_counted_shape(surfaces.size[surfaces.shape == shape], text) for shape, text in SHAPES.items()]
    inside, faces, ridges, held = (np.sum(number == kind) for kind in (INSIDE, ON_PATCH, ON_RIDGE, HELD))
    return [
        f"surfaces: {len(surfaces.shape)}, {', '.join(filter(None, shapes)) or 'of unknown shape'}; "
        f"{counted(len(surfaces.ridge_shape), 'edge')} between them",
        f"nodes: {inside} free, {faces} on surfaces, {ridges} on edges, {held} fixed",
    ]


def _counted_shape(sizes: Floats, what: str) -> str:
    if not len(sizes):
        return ""
    radii = list(dict.fromkeys(f"{size:.4g}" for size in np.sort(sizes))) if what in ("sphere", "cylinder") else []
    return counted(len(sizes), what) + (f" (radius {', '.join(radii)} m)" if radii else "")


def doubtful_patches(movable: MovableSolid) -> Iterator[str]:
    """Yield a sentence on small plane patches that may belong to a curved surface."""
    tet = movable.tetrahedralization
    patch, across = tet.elements.patch[tet.used], tet.elements.neighbour[tet.used]
    share = np.where(across < 0, 1.0, 0.5)  # an interior face has two elements
    faces = np.bincount(patch[patch >= 0], share[patch >= 0], minlength=len(movable.surfaces.shape))
    small = (movable.surfaces.shape == PLANE) & (faces <= SMALL)
    if np.sum(small) >= MANY:
        names = [f"'{name}'" for name, manner in movable.patches.names.items() if np.any(manner[small] != 0)]
        more = ", ..." if len(names) > NAMED else ""
        where = f" in {', '.join(names[:NAMED])}{more}" if names else ""
        yield (
            f"{np.sum(small)} plane surfaces of one or two faces{where}: their nodes do not move. If they are parts "
            "of a "
            'curved surface, specify it with --surfaces, in Python surfaces={"NAME": ka.Cylinder(point, axis, '
            "radius)}, "
            "or ka.Sphere, ka.Cone."
        )
