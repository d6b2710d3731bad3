"""Rotation of subdomains and their magnets by the angles of a case."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import radians
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.magnetostatics.materials.material import Material, Vector
from kohonen_adapt.mesh.motions import Rotation, inverse, moved
from kohonen_adapt.mesh.names import named
from kohonen_adapt.mesh.turning import turned

__all__ = ["turned_materials", "turned_mesh"]


def turned_mesh(mesh: MeshTri, turn: Mapping[str, float]) -> MeshTri:
    """Return the mesh with subdomains turned about the origin, angles in degrees.

    Raises
    ------
    ValueError
        If `turned` refuses a rotation, or a part of a sector is turned out of the sector: its new sides then have no
        names for periodic conditions.
    """
    for name, degrees in turn.items():
        try:
            after = turned(mesh, name, radians(degrees))
        except ValueError as error:
            raise ValueError(f"turn.{name}: {error}") from None
        if len(after.boundary_facets()) != len(mesh.boundary_facets()):
            raise ValueError(
                f"turn.{name} must stay in the mesh; {degrees:g} degrees turn it out of its sector. Take a mesh of the "
                "whole machine, or name the new sides yourself, as examples/motor.py does."
            )
        mesh = after
    return mesh


def turned_materials(
    materials: Mapping[str, Material], mesh: MeshTri, turn: Mapping[str, float]
) -> dict[str, Material]:
    """Return the materials, with magnets in turned subdomains turned, too.

    Raises
    ------
    ValueError
        If only a part of a magnet is turned.
    """
    found = dict(materials)
    for name, degrees in turn.items():
        turns = np.zeros(mesh.t.shape[1], dtype=bool)
        turns[named(mesh.subdomains, name, "subdomain")] = True
        found = {key: _turned(key, each, mesh, turns, Rotation(radians(degrees))) for key, each in found.items()}
    return found


def _turned(name: str, material: Material, mesh: MeshTri, turns: Mask, rotation: Rotation) -> Material:
    elements = (mesh.subdomains or {}).get(name, np.zeros(0, dtype=int))
    vectors = {"remanence": material.remanence, "coercivity": material.coercivity}
    magnetic = {key: each for key, each in vectors.items() if each is not None and each != (0.0, 0.0)}
    if not magnetic or not turns[elements].any():
        return material
    if not turns[elements].all():
        raise ValueError(
            f"the magnet {name!r} must turn as a whole or not at all; only a part of it is in the turned subdomain."
        )
    now: dict[str, Any] = {key: _turned_vector(vector, rotation) for key, vector in magnetic.items()}
    return replace(material, **now)


def _turned_vector(vector: Vector, rotation: Rotation) -> Vector:
    if callable(vector):
        return _TurnedField(vector, rotation)
    x, y = (rotation.matrix[:, :2] @ vector).tolist()
    return x, y


@dataclass(frozen=True)
class _TurnedField:
    field: Callable[[Floats], ArrayLike]
    rotation: Rotation

    def __call__(self, x: Floats) -> ArrayLike:
        return self.rotation.matrix[:, :2] @ np.asarray(self.field(moved(inverse(self.rotation.matrix), x)))
