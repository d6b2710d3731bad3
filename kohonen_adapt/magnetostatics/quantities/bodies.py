"""Find the elements of a body by name, and refuse one without air around it."""

from collections.abc import Sequence

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Mask
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.local_field import LocalField
from kohonen_adapt.mesh.names import named, named_sets

__all__ = ["Names", "air_elements", "elements_in", "isolated_body"]

AIR_TOLERANCE = 1e-6  # of the relative permeability: air as it is (1.0000004) is air

Names = str | Sequence[str]


def elements_in(mesh: MeshTri, names: Names) -> Mask:
    """Which elements are in one of these subdomains, (nelements,)."""
    inside = np.zeros(mesh.t.shape[1], dtype=bool)
    for name in _name_list(names):
        inside[named(mesh.subdomains, name, "subdomain")] = True
    if not inside.any():
        raise ValueError(f"subdomain {_said(names)} has no elements; name one that has.")
    return inside


def air_elements(field: LocalField) -> Mask:
    """Which elements have permeability 1, no current and no remanence, (nelements,)."""
    plain = np.abs(field.reluctivity * VACUUM_PERMEABILITY - 1.0) < AIR_TOLERANCE
    return plain & (field.current_density == 0.0) & ~field.remanence.any(axis=0)


def isolated_body(field: LocalField, names: Names) -> Mask:
    """Which elements are in the body, (nelements,), where there is nothing but air around it.

    Raises
    ------
    ValueError
        If an element that shares a node with the body from outside is not air, or there is none at all.
    """
    mesh, inside = field.mesh, elements_in(field.mesh, names)
    in_body = np.zeros(mesh.p.shape[1], dtype=bool)
    in_body[mesh.t[:, inside]] = True
    around = in_body[mesh.t].any(axis=0) & ~inside
    if not around.any():
        raise ValueError(f"subdomain {_said(names)} has nothing around it; a force needs air between it and the rest.")
    solid = np.flatnonzero(around & ~air_elements(field))
    if solid.size:
        raise ValueError(
            f"subdomain {_said(names)} touches {_names_at(mesh, solid[0])}, which is not air (permeability 1, no "
            "current, no remanence), and the force is told by the field in the air around: leave air between them, "
            "or ask for the force on both together."
        )
    return inside


def _name_list(names: Names) -> list[str]:
    listed = [names] if isinstance(names, str) else list(names) if isinstance(names, Sequence) else []
    if not listed or not all(isinstance(name, str) for name in listed):
        raise ValueError(f"a body is the name of a subdomain or a sequence of names; got {names!r}.")
    return listed


def _said(names: Names) -> str:
    return " + ".join(repr(name) for name in _name_list(names))


def _names_at(mesh: MeshTri, element: int) -> str:
    return " + ".join(repr(name) for name, rows in sorted(named_sets(mesh.subdomains).items()) if element in rows)
