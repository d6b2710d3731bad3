"""Conditions on a scalar potential at boundaries and planes of symmetry."""

from collections.abc import Mapping

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skfem import MeshTet

from kohonen_adapt.arrays import Mask
from kohonen_adapt.magnetostatics.equations.applied_field import Drive
from kohonen_adapt.magnetostatics.equations.conditions import Boundaries, Conditions, Value, fixed_values
from kohonen_adapt.magnetostatics.equations.given_field import field_at
from kohonen_adapt.magnetostatics.equations.symmetry import Mirror, surface
from kohonen_adapt.mesh.measures import magnitude

__all__ = ["conditions_in_space"]

ASYMMETRY = 0.01  # allowed asymmetric part of the applied field on a plane, relative to the largest


def conditions_in_space(drive: Drive, potential: Mapping[str, Value], mirrors: Mapping[str, Mirror]) -> Conditions:
    """Return the conditions on u, the reduced potential, in iron the total one.

    A connected part without a given value has a first node that is neither fixed nor free, because u is determined
    there up to a constant only.
    """
    elements, mesh = drive.elements, drive.elements.mesh
    for name in potential:
        surface(mesh, name, "potential")
    fixed, values = fixed_values(elements, Boundaries(potential))
    for name, mirror in mirrors.items():
        _check_field(drive, name, mirror)
        if mirror.kind == "normal":
            rows = np.unique(elements.on_facets(mirror.facets))
            fixed[rows], values[rows] = True, 0.0
    held, nnodes = fixed.copy(), mesh.p.shape[1]
    held[:nnodes] |= _first_of_floating(mesh, fixed[:nnodes])
    return Conditions(fixed, np.where(held, values + drive.potential, 0.0), np.flatnonzero(~held))


def _check_field(drive: Drive, name: str, mirror: Mirror) -> None:
    if drive.function is None:
        return
    mesh = drive.elements.mesh
    field = field_at(drive.function, mesh.p[:, np.unique(mesh.facets[:, mirror.facets])])
    across = np.outer(mirror.normal, mirror.normal @ field)
    wrong = magnitude(across if mirror.kind == "parallel" else field - across).max()
    if wrong > ASYMMETRY * magnitude(field).max():
        direction = "across" if mirror.kind == "parallel" else "along"
        raise ValueError(
            f"the flux is {mirror.kind} to the plane of symmetry {name!r}, but the applied_field has up to "
            f"{wrong:.3g} A/m {direction} it. Give the field of the whole coils, images included, or another symmetry."
        )


def _first_of_floating(mesh: MeshTet, fixed: Mask) -> Mask:
    nnodes, (a, b, c, d) = fixed.size, mesh.t
    edges = np.concatenate((a, b, c)), np.concatenate((b, c, d))
    _, part = connected_components(coo_array((np.ones(edges[0].size), edges), shape=(nnodes,) * 2), directed=False)
    number, first = np.unique(part, return_index=True)
    chosen = np.zeros(nnodes, dtype=bool)
    chosen[first[~np.isin(number, part[fixed])]] = True
    return chosen
