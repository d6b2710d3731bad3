"""Fitting of spheres and cylinders to constrained faces."""

from dataclasses import dataclass

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.plane.cutting import DISTINCT, FEWEST, LOOSE
from kohonen_adapt.geometry.plane.polylines import BITS, CORNER
from kohonen_adapt.geometry.space.surfaces import across, on_cylinder, on_sphere
from kohonen_adapt.kernels.tetrahedron.arrays import CYLINDER, SPHERE
from kohonen_adapt.mesh.cells import normals

__all__ = ["Round", "are_coaxial", "round_of"]

ON_SPHERE, ON_CYLINDER = 8, 10  # fewest nodes, twice the number of parameters: fewer may fit by chance
COARSE = 4  # minimum number of angles around the axis of a cylinder that is coaxial with another cylinder
STEPS = 10  # iterations of the Gauss-Newton method
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
        Unit vector of the axis of a cylinder, shape (3,).
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

    @property
    def is_coarse(self) -> bool:
        return self.shape == CYLINDER and (self.angles < FEWEST or self.nodes < ON_CYLINDER)

    def distance(self, x: Floats) -> Floats:
        near = (
            on_sphere(x, self.origin, self.size)
            if self.shape == SPHERE
            else on_cylinder(x, self.origin, self.axis, self.size)
        )
        return np.linalg.norm(near - x, axis=1)


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
    centroids = position[nodes].mean(axis=1)
    cylinder, sphere = cylinder_through(x, normal), sphere_through(x)
    found = [each for each in (cylinder, sphere) if each and fits(each, x, normal, centroids)]
    if (
        len(found) == 2
        and cylinder
        and sphere
        and cylinder.deviation > max(2.0 * sphere.deviation, EQUAL * sphere.size)
    ):
        return sphere
    return found[0] if found else None


def fits(found: Round, x: Floats, normal: Floats, centroids: Floats) -> bool:
    if found.angles < (COARSE if found.shape == CYLINDER else ON_SPHERE) or not found.deviation <= LOOSE * found.size:
        return False
    out = centroids - found.origin
    flat = x - found.origin
    if found.shape == CYLINDER:
        out = out - found.axis * (out @ found.axis)[:, None]
        flat = flat - found.axis * (flat @ found.axis)[:, None]
    cosine = np.abs(np.einsum("ij,ij->i", out, normal))
    lengths = np.linalg.norm(out, axis=1) * np.linalg.norm(normal, axis=1)
    return DISTINCT * found.deviation <= least_extent(flat, found) and bool(np.all(cosine > np.cos(CORNER) * lengths))


def least_extent(x: Floats, found: Round) -> float:
    axes = np.linalg.svd(x - x.mean(axis=0), full_matrices=False)[2]
    axes = axes[np.abs(axes @ found.axis) < 0.5] if found.shape == CYLINDER else axes
    return float(np.min(np.ptp(x @ axes.T, axis=0)))


def sphere_through(x: Floats) -> Round | None:
    """Return the least-squares sphere of points (Kasa, 1976, in space), or None.

    The sum of (|x - c|^2 - r^2)^2 is least.
    """
    middle, scale = x.mean(axis=0), np.ptp(x, axis=0).max()
    y = (x - middle) / scale
    solution, _, rank, _ = np.linalg.lstsq(np.column_stack([2.0 * y, np.ones(len(y))]), np.sum(y**2, axis=1))
    if rank < 4:
        return None
    radius = float(np.sqrt(solution[3] + np.sum(solution[:3] ** 2)))
    radius = float(rounded(scale * radius, scale * radius))
    centre = rounded(middle + scale * solution[:3], radius)
    deviation = np.abs(np.linalg.norm(x - centre, axis=1) - radius).max()
    return Round(SPHERE, centre, np.zeros(3), radius, float(deviation), len(x), len(x))


def cylinder_through(x: Floats, normal: Floats) -> Round | None:
    """Return the cylinder with the least sum of squared distances, or None.

    The first axis is the direction most nearly orthogonal to all normals `normal`. Iterations are of Gauss-Newton
    type: with u the unit vector away from the axis and s the coordinate along the axis, a turn of the axis by t changes
    the distance of a point by -s u.t, and a shift by p changes the distance by -u.p.
    """
    middle, scale = x.mean(axis=0), np.ptp(x, axis=0).max()
    y, point = (x - middle) / scale, np.zeros(3)
    weight = np.linalg.norm(normal, axis=1, keepdims=True)
    axis = np.linalg.eigh((normal / weight).T @ normal)[1][:, 0]
    radius = 0.0
    for step in range(STEPS):
        one = across(axis)
        basis = np.stack([one, np.cross(axis, one)])
        along, flat = (y - point) @ axis, (y - point) @ basis.T
        if step == 0:  # least-squares circle of Kasa
            rows = np.column_stack([2.0 * flat, np.ones(len(flat))])
            solution, _, rank, _ = np.linalg.lstsq(rows, np.sum(flat**2, axis=1))
            if rank < 3:
                return None
            point, radius = solution[:2] @ basis, float(np.sqrt(max(solution[2] + np.sum(solution[:2] ** 2), 0.0)))
            continue
        distance = np.linalg.norm(flat, axis=1)
        if not np.all(distance > 0.0):
            return None
        out = flat / distance[:, None]
        rows = np.column_stack([-out, -along[:, None] * out, -np.ones(len(out))])
        solution = np.linalg.lstsq(rows, radius - distance)[0]
        point, radius = point + solution[:2] @ basis, radius + solution[4]
        axis = axis + solution[2:4] @ basis
        axis = axis / np.linalg.norm(axis)
    return cylinder_of(x, middle + scale * point, axis, scale * radius)


def cylinder_of(x: Floats, point: Floats, axis: Floats, radius: float) -> Round | None:
    if not np.isfinite(radius) or radius <= 0.0:
        return None
    axis = rounded(axis * np.sign(axis[np.argmax(np.abs(axis))]), 1.0)
    axis = axis / np.linalg.norm(axis)
    point = rounded(point + axis * ((x.mean(axis=0) - point) @ axis), radius)
    radius = float(rounded(radius, radius))
    one = across(axis)
    flat = (x - point) @ np.stack([one, np.cross(axis, one)]).T
    angle = np.sort(np.arctan2(flat[:, 1], flat[:, 0]))
    angles = int(np.sum(np.diff(angle, append=angle[0] + 2.0 * np.pi) > APART))
    deviation = np.abs(np.linalg.norm(flat, axis=1) - radius).max()
    return Round(CYLINDER, point, axis, radius, float(deviation), len(x), angles)


def rounded(values: Floats | float, size: float) -> Floats:
    step = np.ldexp(1.0, np.frexp(size)[1] - BITS)
    return np.round(np.asarray(values) / step) * step + 0.0  # no -0


def are_coaxial(one: Round, other: Round) -> bool:
    if one.shape != CYLINDER or other.shape != CYLINDER:
        return False
    deviation = other.origin - one.origin
    apart = np.linalg.norm(deviation - one.axis * (deviation @ one.axis))
    turn = np.linalg.norm(np.cross(one.axis, other.axis))
    return bool(apart <= COAXIAL * one.size and turn <= COAXIAL)
