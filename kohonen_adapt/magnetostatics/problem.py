"""The magnetostatic problem of a user: materials by subdomain, potential by boundary, solve and indicators."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.estimators import recovery, residual
from kohonen_adapt.magnetostatics.coefficients import coefficients, material_of_elements, of_materials
from kohonen_adapt.magnetostatics.field import Field
from kohonen_adapt.magnetostatics.material import Material
from kohonen_adapt.magnetostatics.system import Value, fixed_values, solve_potential
from kohonen_adapt.ritz import Ritz
from kohonen_adapt.triangles import area
from kohonen_adapt.triangulation import check_mesh

__all__ = ["RESIDUAL_SCALE", "Magnetostatics"]

Floats = NDArray[np.float64]

# What the residual indicators are multiplied by, so that the root of their sum of squares is near the error.
# The ratio of that root to the true error, unscaled, measured by tests/test_magnetostatics.py and benchmark M:
#     cylinder in a disk, rings, 817 to 12 481 nodes                  3.61 - 3.78
#     rectangle in free space, squares / Gmsh, 400 to 9 500 nodes     3.57 - 3.77 / 3.24 - 3.64
#     benchmark M, permeability 1 / 1000, squares, 441 to 25 921      3.58 - 3.78 / 3.56 - 3.59
#     the same after one to three relocations                         3.51 - 3.66
# With 1 / 3.6 all of them come within 10 %.
RESIDUAL_SCALE = 1.0 / 3.6
ESTIMATORS = {"residual": (residual, RESIDUAL_SCALE), "recovery": (recovery, 1.0)}


@dataclass(frozen=True, eq=False)
class Magnetostatics:
    """Planar linear magnetostatics, ``curl(nu curl A) = J + curl(nu Br)`` for the P1 potential A_z.

    Metres, teslas, amperes; results are per metre of depth. A and J point out of the page, ``B = (dA/dy, -dA/dx)``.
    Where no potential is given the natural condition ``n x H = 0`` holds (flux crosses the boundary at a right angle);
    a constant potential keeps the flux inside. A problem of this kind is what `kohonen_adapt.adapt` takes.

    Parameters
    ----------
    materials
        Subdomain name to `Material`. Every element of the mesh needs exactly one; further subdomains may exist.
    potential
        Boundary name to A_z in Wb/m: a float or a callable of x (2, n) that returns (n,). At least one. At a node of
        two boundaries the later in the mapping counts.
    estimator
        "residual", multiplied by `RESIDUAL_SCALE` = 1 / 3.6 because the bare estimate overrates the error by that
        factor, give or take 10 %; or "recovery", which comes within 5 % by itself.

    Raises
    ------
    ValueError
        For materials, potentials or an estimator of another kind; by `solve` and `indicators` for names that the mesh
        lacks, elements without or with two materials, and parts of the mesh where the potential is fixed nowhere.
    """

    materials: Mapping[str, Material]
    potential: Mapping[str, Value] | None = None
    estimator: str = "residual"

    order: ClassVar[int] = 1
    norm: ClassVar[str] = "energy"

    def __post_init__(self) -> None:
        if self.estimator not in ESTIMATORS:
            raise ValueError(f"estimator must be 'residual' or 'recovery'; got {self.estimator!r}.")
        if not isinstance(self.materials, Mapping):
            raise ValueError(f"materials must map subdomain names to Materials; got {self.materials!r}.")
        for name, material in self.materials.items():
            if not isinstance(material, Material):
                raise ValueError(f"materials[{name!r}] must be a Material; got {material!r}.")
        if not isinstance(self.potential, Mapping) or not self.potential:
            raise ValueError(
                "potential must fix A on at least one boundary, for instance {'outer': 0.0}: "
                f"otherwise A is known only up to a constant; got {self.potential!r}."
            )
        # Copies: what the caller does to the mappings later must not change a problem that has been solved.
        object.__setattr__(self, "materials", dict(self.materials))
        object.__setattr__(self, "potential", dict(self.potential))

    def solve(self, mesh: MeshTri) -> Field:
        """Solve on a mesh by a sparse direct method.

        Parameters
        ----------
        mesh
            A plain `MeshTri` in metres, with the named subdomains and boundaries.

        Returns
        -------
        Field
            The potential and what follows from it.

        Raises
        ------
        ValueError
            See the class; for a broken mesh or one of another kind.
        numpy.linalg.LinAlgError
            If the equations have no finite solution (a kind of ValueError).
        """
        check_mesh(mesh)
        given = coefficients(mesh, self.materials)
        fixed, values = fixed_values(mesh, self.potential or {})
        potential = solve_potential(mesh, given, fixed, values)
        return Field(mesh, potential, given.reluctivity, given.remanence, given.current_density)

    def indicators(self, mesh: MeshTri, field: Field) -> Floats:
        """Error indicators of a solution, near the true error in the energy norm.

        Parameters
        ----------
        mesh
            The mesh of the solution.
        field
            What `solve` returned for it.

        Returns
        -------
        ndarray (nelements,)
            Unsquared, in sqrt(J/m).
        """
        given = coefficients(mesh, self.materials)
        estimate, scale = ESTIMATORS[self.estimator]
        source, flux = given.current_density, given.flux
        return scale * estimate(mesh, field.potential, given.reluctivity, source=source, flux=flux)

    def energy_norm(self, mesh: MeshTri, field: Field) -> float:
        """``sqrt(int nu |B|^2)`` over the mesh in sqrt(J/m), what `estimate` is compared with."""
        return float(np.sqrt(np.sum(area(mesh) * field.reluctivity * field.flux_density**2)))

    def ritz(self, mesh: MeshTri, field: Field) -> Ritz:
        """What A minimises, ``int nu |grad A|^2 / 2 - J A - nu (-Br_y, Br_x) . grad A``, with one number per material.

        Parameters
        ----------
        mesh
            The mesh of the solution.
        field
            What `solve` returned for it.

        Returns
        -------
        Ritz
            In J/m. Of a solution it lies above the exact minimum by half the square of the error in `energy_norm`.
        """
        given, number = of_materials(self.materials), material_of_elements(mesh, self.materials)
        fixed, _ = fixed_values(mesh, self.potential or {})
        return Ritz(field.potential, fixed, given.reluctivity, given.current_density, given.flux, number)
