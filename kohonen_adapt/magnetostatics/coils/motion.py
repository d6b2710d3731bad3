"""Rigid motions, and the images of coils by planes of symmetry."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, FloatsPair, Mask
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.equations.symmetry import Mirror
from kohonen_adapt.mesh.cells import width_of
from kohonen_adapt.mesh.measures import magnitude

__all__ = ["Images", "Motion", "change_of_field", "images_of", "motion_of"]

STEP = 1e-2  # largest displacement of a coil in a central difference, relative to its section
EQUAL = 1e-6  # tolerance of equal reflections
ON_PLANE = 1e-9  # tolerance of points on planes, relative to the size of the mesh
MOST_IMAGES = 48  # of three planes


class Motion(NamedTuple):
    # velocity ``shift + turn (x - centre)``, in the plane and in space
    shift: Floats  # (d,)
    turn: Floats  # (d, d), antisymmetric
    centre: Floats  # (d,)

    def at(self, x: Floats) -> Floats:
        return self.shift[:, None] + self.turn @ (x - self.centre[:, None])


def motion_of(vector: Floats, centre: Floats | None) -> Motion:
    """Return the shift along a vector, or the turn about an axis through a centre."""
    if centre is None:
        return Motion(vector, np.zeros((vector.size,) * 2), np.zeros(vector.size))
    turn = np.cross(vector, np.eye(3)).T[: centre.size, : centre.size]
    return Motion(np.zeros(centre.size), turn, centre)


def change_of_field(coil: Coil, motion: Motion, x: Floats) -> Floats:
    step = STEP * min(coil.width, coil.height) / magnitude(motion.at(coil.path)).max()
    generator, total = np.zeros((4, 4)), np.zeros_like(x)
    generator[:3, :3], generator[:3, 3:] = motion.turn, motion.at(np.zeros((3, 1)))
    for sign in (1.0, -1.0):
        moved = expm(sign * step * generator)
        rotation, shift = moved[:3, :3], moved[:3, 3]
        total += sign * (rotation @ coil.field_strength(rotation.T @ (x - shift[:, None])))
    return total / (2.0 * step)


class Images(NamedTuple):
    # Products ``x -> matrix x + shift`` of reflections by planes of symmetry, the identity first.
    # B, H and M at an image are ``sign matrix`` times their values at the point.

    matrix: Floats  # (m, 3, 3)
    shift: Floats  # (m, 3)
    sign: Floats  # (m,)
    normal: Floats  # (k, 3), out of the mesh
    level: Floats  # (k,): largest height of the mesh along each normal

    def points(self, x: Floats, image: int) -> Floats:
        return self.matrix[image] @ x + self.shift[image][:, None]

    def pulled(self, values: Floats, image: int) -> Floats:
        return self.sign[image] * (self.matrix[image].T @ values)

    def moved(self, motion: Motion, image: int) -> Motion:
        matrix = self.matrix[image]
        turn = matrix @ motion.turn @ matrix.T
        shift = matrix @ motion.at(np.zeros((3, 1)))[:, 0] - turn @ self.shift[image]
        return Motion(shift, turn, np.zeros(3))

    def folded(self, x: Floats, current: Floats) -> FloatsPair:
        x, current = x.copy(), current.copy()
        for image, matrix in enumerate(self.matrix):  # the identity first
            y = self.points(x, image)
            rows = ~self.contain(x) & self.contain(y)
            x[:, rows] = y[:, rows]
            current[:, rows] = self.sign[image] * np.linalg.det(matrix) * (matrix @ current[:, rows])
        return x, current

    def contain(self, x: Floats) -> Mask:
        return np.all(self.normal @ x <= self.level[:, None], axis=0)


def images_of(mesh: MeshTet, mirrors: Iterable[Mirror]) -> Images:
    planes, found = list(mirrors), [(np.eye(3), np.zeros(3), 1.0)]
    for matrix, shift, sign in found:  # grows
        for mirror in planes:
            product, origin = mirror.reflection @ matrix, mirror.image(shift[:, None])[:, 0]
            if len(found) < MOST_IMAGES and all(np.abs(product - other).max() > EQUAL for other, _, _ in found):
                found.append((product, origin, mirror.sign * sign))
    tolerance = ON_PLANE * width_of(mesh)
    matrices, shifts, signs = (np.array(part) for part in zip(*found, strict=True))
    normal = np.reshape([mirror.normal for mirror in planes], (-1, 3))
    return Images(matrices, shifts, signs, normal, np.array([mirror.level + tolerance for mirror in planes]))
