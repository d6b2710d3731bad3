"""Bodies in air, by names of subdomains."""

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh, MeshTri

from kohonen_adapt.arrays import Ints, Mask
from kohonen_adapt.geometry.plane.curves import Arc
from kohonen_adapt.magnetostatics.materials.coefficients import subdomains_at
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField
from kohonen_adapt.mesh.names import Names, elements_in, joined_names, named_sets

__all__ = [
    "Names",
    "air_elements",
    "bores",
    "isolated_body",
    "outer_facets",
]

AIR_TOLERANCE = 1e-6  # of the relative permeability; real air has 1.0000004
NEAR = 1e-9  # tolerance of lengths, relative to the size of the mesh
BORE_FACETS = (2, 4, 10)  # number of facets of a bore taken as an arc: minimum, maximum, and maximum of a circle


def air_elements(field: MagneticField) -> Mask:
    coefficients = field.coefficients
    plain = np.abs(coefficients.reluctivity * VACUUM_PERMEABILITY - 1.0) < AIR_TOLERANCE
    return plain & ~coefficients.nonlinear & (field.current_in_shells == 0.0) & ~field.remanence.any(axis=0)


def isolated_body(field: MagneticField, names: Names) -> Mask:
    mesh, inside, text = field.elements.corners, elements_in(field.mesh, names), joined_names(names)
    in_body = np.zeros(mesh.nvertices, bool)
    in_body[mesh.t[:, inside]] = True
    around = in_body[mesh.t].any(axis=0) & ~inside
    if not around.any():
        raise ValueError(f"subdomain {text} has no other elements around it; a force requires air around the body.")
    solid = np.flatnonzero(around & ~air_elements(field))
    driven = solid[field.current_in_shells[solid] != 0.0] if len(mesh.p) == 3 else solid[:0]
    if driven.size:
        raise ValueError(
            f"subdomain {text} touches {subdomains_at(mesh, driven[:1])} where the current of the "
            "applied_field runs, and the force is computed from the field in air without current: give the coil in "
            "coils, or mesh the coil as a volume of air of its own, with air between it and the body."
        )
    if solid.size:
        raise ValueError(
            f"subdomain {text} touches {subdomains_at(mesh, solid[:1])}, which is not air "
            "(permeability 1, no current, no remanence), and the force is computed from the field in the air around: "
            "leave air between them, or compute the force on both together."
        )
    return inside


def bores(mesh: MeshTri, names: Names, centre: ArrayLike) -> dict[str, Arc]:
    """Return the boundaries that are arcs because a body that turns ends there.

    Only boundaries with too few nodes to be recognised as arcs are returned.
    """
    x, y = np.asarray(centre, float)
    outer, radius, found = outer_facets(mesh, elements_in(mesh, names)), np.hypot(mesh.p[0] - x, mesh.p[1] - y), {}
    for name, rows in named_sets(mesh.boundaries).items():
        facets, nodes = np.unique(rows), np.unique(mesh.facets[:, rows])
        is_coarse = BORE_FACETS[0] <= len(facets) <= BORE_FACETS[1 + (len(nodes) == len(facets))]
        if is_coarse and np.isin(facets, outer).all() and np.ptp(radius[nodes]) <= NEAR * radius.max():
            found[name] = Arc((float(x), float(y)), float(radius[nodes].mean()))
    return found


def outer_facets(mesh: Mesh, inside: Mask) -> Ints:
    outer = mesh.boundary_facets()
    return outer[inside[mesh.f2t[0, outer]]]
