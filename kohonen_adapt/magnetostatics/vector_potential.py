"""Magnetostatic problems in space by a vector potential on edge elements."""

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.arguments import ArgumentsInSpace, solved
from kohonen_adapt.magnetostatics.equations.applied_field import permeable
from kohonen_adapt.magnetostatics.equations.edge_elements import (
    EdgeElements,
    conditions_on_edges,
    open_surfaces,
    prescribed_flux_load,
)
from kohonen_adapt.magnetostatics.equations.edge_equations import edge_drive
from kohonen_adapt.magnetostatics.equations.edge_solver import EdgeSolver
from kohonen_adapt.magnetostatics.equations.newton import (
    TOLERANCE,
    Newton,
)
from kohonen_adapt.magnetostatics.field_problem import FieldProblem
from kohonen_adapt.magnetostatics.quantities.coil_quantities import ends_far
from kohonen_adapt.magnetostatics.quantities.edge_field import EdgeField
from kohonen_adapt.magnetostatics.quantities.goals import Goal
from kohonen_adapt.magnetostatics.solid_estimation import tangential_jumps
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.names import named
from kohonen_adapt.problem.energy import Energy

__all__ = ["MagneticVectorPotential"]

RTOL_OF_STEPS = 1e-2  # of a Newton step in the energy norm
SMALL = 0.1 * TOLERANCE  # residual after which Newton's method makes no further step, relative to the terms


@dataclass(frozen=True, eq=False)
class MagneticVectorPotential(ArgumentsInSpace, FieldProblem[MeshTet, EdgeField]):
    """Magnets and iron in space, by a vector potential on edge elements.

    The equations are ``curl H = curl Hs`` with ``H = nu(|B|) B - Hc`` and ``B = curl A``, in metres, teslas and
    amperes. B is free of divergence, so that fluxes are right in iron, also in thin saturated plates.

    The arguments and the conditions on the boundary are those of `MagneticScalarPotential`, and both problems have the
    same exact solution. Their energies bound the exact energy from both sides, see `bracket`. `kohonen_adapt.adapt`
    takes a problem of this class, without a polish. For a goal, adapt the mesh by `MagneticScalarPotential(goal=...)`
    and solve on it. Edges of a `MeshTet2` count as straight.

    Parameters
    ----------
    materials
        Subdomain name to `Material`, as in `MagneticScalarPotential`.
    potential
        Name of an outer boundary to phi in A, as in `MagneticScalarPotential`: ``n x (H - Hs) = -n x grad phi`` there.
        0 on the boundary of a large volume of air.
    applied_field
        Hs as in `MagneticScalarPotential`.
    symmetry
        Name of a plane in which the mesh ends to the direction of the flux there, "parallel" or "normal".
    coils
        Name to `Coil`, as in `MagneticScalarPotential`.

    Raises
    ------
    ValueError
        For invalid arguments. `solve` raises it for names that the mesh lacks, elements with no or two materials,
        surfaces that are no planes of symmetry, a potential inside the mesh, potentials on separate closed surfaces,
        an applied field that is not finite or contradicts the symmetry, and coils that meet iron or a magnet, leave
        the mesh or do not have the symmetry.

    Examples
    --------
    >>> import numpy as np, skfem
    >>> from kohonen_adapt.magnetostatics import MagneticVectorPotential, Material
    >>> mesh = skfem.MeshTet.init_tensor(*[np.linspace(0.0, 1.0, 5)] * 3).with_defaults()
    >>> mesh = mesh.with_subdomains({"magnet": lambda x: x[2] < 0.5, "air": lambda x: x[2] > 0.5})
    >>> materials = {"magnet": Material(remanence=(0.0, 0.0, 1.2)), "air": Material()}
    >>> field = MagneticVectorPotential(materials, potential={"front": 0.0, "back": 0.0}).solve(mesh)
    >>> np.allclose(field.flux_density, [[0.0], [0.0], [0.6]], atol=1e-6)  # of a magnet between iron, over as much air
    True
    """

    order: ClassVar[int] = 1
    goal: Goal | None = field(default=None, init=False)
    solver: ClassVar[EdgeSolver] = EdgeSolver()  # subclasses may override
    no_goal: ClassVar[str] = ", which a vector potential does not take; use MagneticScalarPotential."

    def solve(self, mesh: MeshTet) -> EdgeField:
        energy, start = self.functional_on(mesh)
        if energy.is_quadratic:
            return solved(start, Newton(solver=self.solver).linear(energy))
        floor = SMALL * float(np.linalg.norm(energy.load))
        method = Newton(solver=replace(self.solver, rtol=RTOL_OF_STEPS, floor=floor))
        return solved(start, *method.descend(energy, method.linear(energy)))

    def check(self, mesh: MeshTet) -> None:
        self.functional_on(mesh)

    def functional_on(self, mesh: MeshTet) -> tuple[Energy, EdgeField]:
        """Return the functional to minimise on a mesh, and the field before the solve.

        Parameters
        ----------
        mesh
            As in `solve`.

        Returns
        -------
        Energy, EdgeField
            The unknown of the field is 0.

        Raises
        ------
        ValueError
            As in `solve`.
        """
        mesh = corners_of(mesh)
        material, planes = self.given_on(mesh)
        edges = EdgeElements(Space(mesh, 1, varies=self.free_field is not None))
        drive = edge_drive(edges, permeable(material), self.free_field)
        prescribed = self.conditions(drive, planes)
        far = ends_far(drive, prescribed, planes.values())
        crossed = self._crossed(edges, [plane.facets for plane in planes.values() if plane.kind == "normal"])
        conditions = conditions_on_edges(edges, np.setdiff1d(mesh.boundary_facets(), crossed))
        load = edges.assemble_vector(edges.against_gradients(drive.mean + material.coercivity))
        load += prescribed_flux_load(edges, crossed, prescribed.values)
        zero = EdgeField(mesh, np.zeros(load.size), material, drive, planes, far=far)
        return Energy(edges, material.densities(edges.volumes), load, conditions), zero

    def _crossed(self, edges: EdgeElements, normal: list[Ints]) -> Ints:
        # outer facets that the flux may cross
        mesh = edges.mesh
        for name in self.potential or {}:
            facets = np.asarray(named(mesh.boundaries, name, "boundary"))
            if np.any(mesh.f2t[1, facets] >= 0):
                raise ValueError(
                    f"the potential of {name!r} is inside the mesh, where a vector potential takes none; name an outer "
                    "boundary, or use MagneticScalarPotential."
                )
            normal = [*normal, facets]
        crossed = np.unique(np.concatenate([np.zeros(0, np.int64), *normal]))
        if open_surfaces(edges, crossed) > 1:
            raise ValueError(
                "potentials are given on separate closed surfaces of the mesh, and flux from one to the other has no "
                "vector potential; keep the potential of one surface, or use MagneticScalarPotential."
            )
        return crossed

    @property
    def calibrated(self) -> bool:
        """False, because a scalar potential determines the scale of the indicators."""
        return False

    def _of_energy(self, field: EdgeField) -> Floats:
        return tangential_jumps(field)
