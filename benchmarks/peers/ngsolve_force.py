"""Force on a body by the stress around it, in NGSolve's elements."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.peers.ngsolve_mesh import ends_of
from kohonen_adapt.magnetostatics import Material
from kohonen_adapt.magnetostatics.quantities.cuts import Cut

VACUUM_PERMEABILITY = 4e-7 * np.pi


def pull(field: Any, body: str | Sequence[str], cut: Cut) -> np.ndarray:
    """Return the force density of an `NgsolveField` on a body times volumes, at its integration points, (2, n).

    Minus Maxwell's stress tensor times the gradient of a weight, which is harmonic in the air, 1 on the body, and 0 on
    everything else and on the outer boundary except the cut.
    """
    slope, b = _weight_gradient(field, body, cut), field.b
    density = 0.5 * np.sum(b**2, axis=0) * slope - np.sum(b * slope, axis=0) * b
    return field.point_volumes * density / VACUUM_PERMEABILITY


def _weight_gradient(field: Any, body: str | Sequence[str], cut: Cut) -> np.ndarray:
    ng, mesh, problem = field.ng, field.skfem_mesh, field.problem
    space = ng.H1(field.mesh, order=field.order)
    if problem.pairs:
        space = ng.Periodic(space)
    ours = np.isin(field.numbers, field.elements_in(body))
    weight, free = ng.GridFunction(space), ng.BitArray(space.FreeDofs())
    outer = np.sort(mesh.facets[:, np.setdiff1d(mesh.boundary_facets(), cut.facets)], axis=0)
    sides = set(zip(*outer.tolist(), strict=True))
    fixed = [edge for edge in field.mesh.edges if ends_of(edge) in sides]
    fixed += [ng.NodeId(ng.VERTEX, node) for node in np.unique(outer).tolist()]
    solid = [name for name, given in problem.materials.items() if given != Material()]
    held = ours | np.isin(field.numbers, field.elements_in([*solid, *problem.ampere_turns]))
    fixed += [ng.ElementId(ng.VOL, element) for element in np.flatnonzero(held).tolist()]
    for part in fixed:
        for unknown in space.GetDofNrs(part):
            free[unknown] = False
    for node in np.unique(mesh.t[:, field.numbers[ours]]).tolist():
        for unknown in space.GetDofNrs(ng.NodeId(ng.VERTEX, node)):
            weight.vec[unknown] = 1.0
    u, v = space.TnT()
    form = ng.BilinearForm(ng.grad(u) * ng.grad(v) * ng.dx).Assemble()
    weight.vec.data -= form.mat.Inverse(free, inverse="sparsecholesky") * (form.mat * weight.vec).Evaluate()
    return np.stack([field.at_points(ng.grad(weight)[k]) for k in range(2)])
