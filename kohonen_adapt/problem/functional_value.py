"""Value of a Ritz functional on any mesh."""

import numpy as np
from skfem import Mesh

from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.measures import CurvedTetrahedra
from kohonen_adapt.mesh.quadratic_in_space import quadratic_coefficients
from kohonen_adapt.problem.functional_in_plane import value_of_part
from kohonen_adapt.problem.functional_in_space import value_in_space, value_of_order_2
from kohonen_adapt.problem.ritz import Ritz, check_matches, parts_of, plane_only_term
from kohonen_adapt.problem.surface_terms import corner_values, nodal_terms, reduced_regions, surface_work

__all__ = ["functional_value"]


def functional_value(mesh: Mesh, ritz: Ritz) -> float:
    if mesh.dim() == TETRAHEDRON.dim:
        if plane_only_term(ritz):
            raise ValueError(f"Ritz cannot be evaluated on tetrahedra: {plane_only_term(ritz)}.")
        check_matches(ritz, mesh)
        region = np.zeros(mesh.t.shape[1], dtype=np.int64) if ritz.region is None else np.asarray(ritz.region)
        if ritz.order == 2:
            coefficients = quadratic_coefficients(mesh, np.asarray(ritz.values))
            offset = CurvedTetrahedra(mesh).offset
            return value_of_order_2(mesh.p[:, mesh.t], offset, coefficients, mesh.t, region, ritz)
        values, nodal = np.asarray(ritz.values), nodal_terms(ritz.surface)
        on_corners = corner_values(values, nodal, mesh.t, reduced_regions(ritz.surface, region))
        return value_in_space(mesh.p[:, mesh.t], on_corners, region, ritz) - surface_work(values, nodal)
    return sum(value_of_part(mesh, part) for part in parts_of(ritz))
