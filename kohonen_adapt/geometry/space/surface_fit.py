"""Fitting of spheres and cylinders to constrained faces."""

from dataclasses import dataclass, replace

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.circles import fitted_sphere, rounded
from kohonen_adapt.geometry.plane.cutting import DISTINCT, FEWEST, LOOSE
from kohonen_adapt.geometry.plane.polylines import CORNER
from kohonen_adapt.geometry.space.surfaces import across
from kohonen_adapt.kernels.tetrahedron.arrays import CYLINDER, SPHERE
from kohonen_adapt.mesh.cells import normals

__all__ = ["Round", "are_coaxial", "round_of"]

ON_SPHERE, ON_CYLINDER = 8, 10  # fewest nodes, twice the number of parameters: fewer may fit by chance
COARSE = 4  # minimum number of angles around the axis of a cylinder that is coaxial with another cylinder
STEPS = 9  # iterations of the Gauss-Newton method
APART = 1e-6  # radians: nearer angles around an axis count as one
EQUAL = 1e-9  # distance below which differences are rounding errors, relative to the radius
COAXIAL = 1e-3  # maximum distance of axes relative to the radius, and maximum angle in radians


@dataclass(frozen=True)
class Round:
    """Sphere or cylinder fitted to nodes.

    Attributes
    ----------
    shape
        SPHERE or CYLINDER.
    origin
        Centre, or point of the axis, shape (3,).
    axis
        Unit vector of the axis of a cylinder, zero for a sphere, shape (3,).
    size
        Radius.
    deviation
        Largest distance of a node.
    nodes
        Number of nodes.
    angles
        Number of different angles of the nodes around the axis; of a sphere the number of nodes.
    """

    shape: int
    origin: Floats  # (3,)
    axis: Floats  # (3,)
    size: float
    deviation: float
    nodes: int
    angles: int

    @classmethod
    def of(cls, origin: Floats, axis: Floats, size: float, x: Floats) -> "Round":
        is_cylinder = bool(axis.any())
        found = cls(CYLINDER if is_cylinder else SPHERE, origin, axis, size, 0.0, len(x), len(x))
        angles = angles_around(found.out(x), axis) if is_cylinder else len(x)
        return replace(found, deviation=float(found.distance(x).max()), angles=angles)

    @property
    def is_coarse(self) -> bool:
        return self.shape == CYLINDER and (self.angles < FEWEST or self.nodes < ON_CYLINDER)

    def out(self, x: Floats) -> Floats:
        """Return the vectors from the centre, or from the axis."""
        out = x - self.origin
        return out - self.axis * (out @ self.axis)[:, None]

    def distance(self, x: Floats) -> Floats:
        return np.abs(np.linalg.norm(self.out(x), axis=1) - self.size)


def round_of(position: Floats, nodes: Ints) -> Round | None:
    """Return the cylinder or sphere on which faces lie, or None.

    `nodes`, shape (f, 3), are the nodes of the faces. Nodes may be off by `LOOSE` of the radius and by 1 / `DISTINCT`
    of their own thickness; faces deviate from the tangent plane by less than 35 degrees. Nodes on two circles fit a
    sphere and a cylinder: the cylinder is returned.
    """
    x = position[np.unique(nodes)]
    if len(x) < FEWEST:
        return None
    normal = normals(position, nodes)
    cylinder, sphere = (
        each if each and fits(each, x, normal, position[nodes].mean(axis=1)) else None
        for each in (cylinder_through(x, normal), sphere_of(x))
    )
    if cylinder and sphere and cylinder.deviation > max(2.0 * sphere.deviation, EQUAL * sphere.size):
        return sphere
    return cylinder or sphere


def fits(found: Round, x: Floats, normal: Floats, centroids: Floats) -> bool:
    if found.angles < (COARSE if found.shape == CYLINDER else ON_SPHERE) or not found.deviation <= LOOSE * found.size:
        return False
    out = found.out(centroids)
    cosine = np.abs(np.einsum("ij,ij->i", out, normal))
    lengths = np.linalg.norm(out, axis=1) * np.linalg.norm(normal, axis=1)
    extent = least_extent(found.out(x), found)
    return DISTINCT * found.deviation <= extent and bool(np.all(cosine > np.cos(CORNER) * lengths))


def least_extent(x: Floats, found: Round) -> float:
    axes = np.linalg.svd(x - x.mean(axis=0), full_matrices=False)[2]
    return float(np.min(np.ptp(x @ axes[np.abs(axes @ found.axis) < 0.5].T, axis=0)))


def sphere_of(x: Floats) -> Round | None:
    centre, radius = fitted_sphere(x)
    return Round.of(centre, np.zeros(3), radius, x) if radius < np.inf else None


def cylinder_through(x: Floats, normal: Floats) -> Round | None:
    """Return the cylinder with the least sum of squared distances, or None.

    The first axis is the direction most nearly orthogonal to all normals `normal`. Iterations are of Gauss-Newton
    type: with u the unit vector away from the axis and s the coordinate along the axis, a turn of the axis by t changes
    the distance of a point by -s u.t, and a shift by p changes the distance by -u.p.
    """
    middle, scale = x.mean(axis=0), np.ptp(x, axis=0).max()
    y = (x - middle) / scale
    weight = np.linalg.norm(normal, axis=1, keepdims=True)
    axis = np.linalg.eigh((normal / weight).T @ normal)[1][:, 0]
    centre, radius = fitted_sphere(y @ basis_of(axis).T)
    point = centre @ basis_of(axis)
    for _ in range(STEPS if radius < np.inf else 0):
        basis = basis_of(axis)
        along, flat = (y - point) @ axis, (y - point) @ basis.T
        distance = np.linalg.norm(flat, axis=1)
        if not np.all(distance > 0.0):
            return None
        out = flat / distance[:, None]
        rows = np.column_stack([-out, -along[:, None] * out, -np.ones(len(out))])
        solution = np.linalg.lstsq(rows, radius - distance)[0]
        point, radius = point + solution[:2] @ basis, radius + solution[4]
        axis = axis + solution[2:4] @ basis
        axis = axis / np.linalg.norm(axis)
    if not 0.0 < radius < np.inf:
        return None
    axis = rounded(axis * np.sign(axis[np.argmax(np.abs(axis))]), 1.0)
    axis, point, radius = axis / np.linalg.norm(axis), middle + scale * point, scale * radius
    point = rounded(point + axis * ((middle - point) @ axis), radius)
    return Round.of(point, axis, float(rounded(radius, radius)), x)


def basis_of(axis: Floats) -> Floats:
    one = across(axis)
    return np.stack([one, np.cross(axis, one)])


def angles_around(out: Floats, axis: Floats) -> int:
    # number of different angles of vectors from an axis
    angle = np.sort(np.arctan2(*(basis_of(axis)[::-1] @ out.T)))
    return int(np.sum(np.diff(angle, append=angle[0] + 2.0 * np.pi) > APART))


def are_coaxial(one: Round, other: Round) -> bool:
    if one.shape != CYLINDER or other.shape != CYLINDER:
        return False
    apart, turn = np.linalg.norm(one.out(other.origin[None])), np.linalg.norm(np.cross(one.axis, other.axis))
    return bool(apart <= COAXIAL * one.size and turn <= COAXIAL)
