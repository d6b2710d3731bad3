"""Rigid motions, and the images of coils by planes of symmetry."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, FloatsPair, Function, Mask
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.equations.symmetry import Mirror
from kohonen_adapt.mesh.cells import width_of
from kohonen_adapt.mesh.measures import magnitude
from kohonen_adapt.mesh.motions import moved

__all__ = ["Images", "change_of_field", "images_of", "motion_of"]

STEP = 1e-2  # largest displacement of a coil in a central difference, relative to its section
EQUAL = 1e-6  # tolerance of equal reflections
ON_PLANE = 1e-9  # tolerance of points on planes, relative to the size of the mesh
MOST_IMAGES = 48  # of three planes


def motion_of(vector: Floats, centre: Floats | None) -> Floats:
    """Return the shift along a vector, or the turn about an axis through a centre.

    The motion is a matrix (d, d + 1) whose product with (x, 1) is the velocity at x.
    """
    if centre is None:
        return np.column_stack((np.zeros((vector.size,) * 2), vector))
    turn = np.cross(vector, np.eye(3)).T[: centre.size, : centre.size]
    return np.column_stack((turn, -turn @ centre))


def change_of_field(coil: Coil, motion: Floats, x: Floats) -> Floats:
    step = STEP * min(coil.width, coil.height) / magnitude(moved(motion, coil.path)).max()
    generator, total = np.vstack((motion, np.zeros(4))), np.zeros_like(x)
    for sign in (1.0, -1.0):
        rotation, shift = np.split(expm(sign * step * generator)[:3], [3], axis=1)
        total += sign * (rotation @ coil.field_strength(rotation.T @ (x - shift)))
    return total / (2.0 * step)


class Images(NamedTuple):
    # Products ``x -> matrix (x, 1)`` of reflections by planes of symmetry, the identity first.
    # B, H and M at an image are the sign times the reflected values at the point.

    matrix: Floats  # (m, 3, 4)
    sign: Floats  # (m,)
    normal: Floats  # (k, 3), out of the mesh
    level: Floats  # (k,): largest height of the mesh along each normal

    def pulled(self, field: Function, x: Floats, image: int) -> Floats:
        """Return the values at x of the image of a field."""
        matrix = self.matrix[image]
        return self.sign[image] * (matrix[:, :3].T @ field(moved(matrix, x)))

    def moved(self, motion: Floats, image: int) -> Floats:
        rotation, shift = np.split(self.matrix[image], [3], axis=1)
        turn = rotation @ motion[:, :3] @ rotation.T
        return np.hstack((turn, rotation @ motion[:, 3:] - turn @ shift))

    def folded(self, x: Floats, current: Floats) -> FloatsPair:
        x, current = x.copy(), current.copy()
        for matrix, sign in zip(self.matrix, self.sign, strict=True):  # the identity first
            y, rotation = moved(matrix, x), matrix[:, :3]
            rows = ~self.contain(x) & self.contain(y)
            x[:, rows] = y[:, rows]
            current[:, rows] = sign * np.linalg.det(rotation) * (rotation @ current[:, rows])
        return x, current

    def contain(self, x: Floats) -> Mask:
        return np.all(self.normal @ x <= self.level[:, None], axis=0)


def images_of(mesh: MeshTet, mirrors: Iterable[Mirror]) -> Images:
    planes, found = list(mirrors), [(np.eye(3, 4), 1.0)]
    for matrix, sign in found:  # grows
        for mirror in planes:
            product = mirror.reflection @ matrix
            product[:, 3] += 2.0 * mirror.level * mirror.normal
            if len(found) < MOST_IMAGES and all(np.abs(product - other)[:, :3].max() > EQUAL for other, _ in found):
                found.append((product, mirror.sign * sign))
    matrices, signs = (np.array(part) for part in zip(*found, strict=True))
    normal = np.reshape([mirror.normal for mirror in planes], (-1, 3))
    tolerance = ON_PLANE * width_of(mesh)
    return Images(matrices, signs, normal, np.array([mirror.level + tolerance for mirror in planes]))
