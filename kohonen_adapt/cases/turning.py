"""Rotation of subdomains and their magnets by the angles of a case."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import radians
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import DataFunction, Floats, grouped
from kohonen_adapt.cases.readers import NUMBER, TEXT, list_of, read_table, table_of
from kohonen_adapt.magnetostatics.materials.material import Material, Vector
from kohonen_adapt.mesh.host import set_boundaries
from kohonen_adapt.mesh.motions import Pair, Rotation, inverse, moved
from kohonen_adapt.mesh.names import connected_components_of, elements_in, named
from kohonen_adapt.mesh.turning import turned

__all__ = ["Turn", "turn", "turned_materials", "turned_mesh"]

Turn = Mapping[tuple[str, ...], float]  # subdomains that turn together to their angle in degrees

PARTS = {"parts": list_of(TEXT), "degrees": NUMBER}
RIM = "\0rim"  # in no file


def turn(given: Any, location: str) -> Turn:
    if isinstance(given, dict) and "parts" in given:
        values = read_table(given, PARTS, location, required=tuple(PARTS))
        return {tuple(values["parts"]): values["degrees"]}
    return {(name,): degrees for name, degrees in table_of(NUMBER)(given, location).items()}


def turned_mesh(mesh: MeshTri, turn: Turn, pairs: Iterable[Pair]) -> MeshTri:
    """Return the mesh with subdomains turned about the origin.

    Arcs of the circle of rotation that are new on the boundary of a sector belong to the side of a pair, periodic or
    antiperiodic, that they connect.

    Raises
    ------
    ValueError
        If `turned` refuses a rotation, or a part is turned out of a sector without pairs.
    """
    sides = [name for pair in pairs for name in pair[:2]]
    for names, degrees in turn.items():
        with_rim = mesh.with_boundaries({RIM: mesh.boundary_facets()})
        try:
            mesh = with_arcs_on(sides, turned(with_rim, names, radians(degrees)))
        except ValueError as error:
            raise ValueError(f"turn{f'.{names[0]}' if len(names) == 1 else ''}: {error}") from None
    return mesh


def with_arcs_on(sides: Iterable[str], mesh: MeshTri) -> MeshTri:
    boundaries = dict(mesh.boundaries or {})
    arcs = np.setdiff1d(mesh.boundary_facets(), boundaries.pop(RIM))
    label = connected_components_of(mesh.p.shape[1], mesh.facets[:, arcs].T)
    for rows in grouped(label[mesh.facets[0, arcs]]):
        arc, ends = arcs[rows], mesh.facets[:, arcs[rows]]
        touched = [name for name in sides if np.isin(mesh.facets[:, named(boundaries, name, "boundary")], ends).any()]
        if len(set(touched)) != 1:
            raise ValueError(
                "the angle turns it out of the mesh, which is a sector without a pair of sides there. Give the sides "
                "as periodic or antiperiodic, or take a mesh of the whole machine."
            )
        boundaries[touched[0]] = np.union1d(boundaries[touched[0]], arc)
    renamed = replace(mesh)
    set_boundaries(renamed, boundaries)
    return renamed


def turned_materials(materials: Mapping[str, Material], mesh: MeshTri, turn: Turn) -> dict[str, Material]:
    """Return the materials, with magnets in turned subdomains turned, too.

    Raises
    ------
    ValueError
        If only a part of a magnet is turned.
    """
    found = dict(materials)
    for names, degrees in turn.items():
        turns, rotation = elements_in(mesh, names), Rotation(radians(degrees))
        for name, material in found.items():
            inside = turns[(mesh.subdomains or {}).get(name, np.zeros(0, int))]
            vectors = {"remanence": material.remanence, "coercivity": material.coercivity}
            magnetic = {key: each for key, each in vectors.items() if each is not None and each != (0.0, 0.0)}
            if not magnetic or not inside.any():
                continue
            if not inside.all():
                raise ValueError(
                    f"the magnet {name!r} must turn as a whole or not at all; only a part of it is in the turned "
                    "subdomain."
                )
            now: dict[str, Any] = {key: _turned_vector(vector, rotation) for key, vector in magnetic.items()}
            found[name] = replace(material, **now)
    return found


def _turned_vector(vector: Vector, rotation: Rotation) -> Vector:
    if callable(vector):
        return _TurnedField(vector, rotation)
    x, y = (rotation.matrix[:, :2] @ vector).tolist()
    return x, y


@dataclass(frozen=True)
class _TurnedField:
    field: DataFunction
    rotation: Rotation

    def __call__(self, x: Floats) -> ArrayLike:
        return self.rotation.matrix[:, :2] @ np.asarray(self.field(moved(inverse(self.rotation.matrix), x)))
