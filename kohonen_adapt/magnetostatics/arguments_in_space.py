"""Arguments and boundary conditions of both potentials in space."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, TypeVar

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skfem import MeshTet
from skfem.mesh import MeshTet1, MeshTet2

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.coils.placement import check_placement, checked_coils
from kohonen_adapt.magnetostatics.equations.applied_field import Drive, permeable
from kohonen_adapt.magnetostatics.equations.conditions import Boundaries, Conditions, Value, fixed_values
from kohonen_adapt.magnetostatics.equations.given_field import AppliedField, checked_field, field_at, sources_of
from kohonen_adapt.magnetostatics.equations.newton import Newton, NewtonStep, refuse_unconverged
from kohonen_adapt.magnetostatics.equations.symmetry import Mirror, checked_symmetry, mirrors_of, surface
from kohonen_adapt.magnetostatics.equations.system import IN_SPACE
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients, coefficients
from kohonen_adapt.magnetostatics.materials.material import Material, check_materials
from kohonen_adapt.magnetostatics.quantities.local_solid import LocalSolid
from kohonen_adapt.mesh.cells import remedy_for
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.measures import magnitude
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["ArgumentsInSpace", "solved"]

SolidKind = TypeVar("SolidKind", bound=LocalSolid)


@dataclass(frozen=True, eq=False)
class ArgumentsInSpace:
    materials: Mapping[str, Material]
    potential: Mapping[str, Value] | None = None
    applied_field: Any = None
    symmetry: Mapping[str, str] | None = None
    coils: Mapping[str, Coil] | None = field(default=None, kw_only=True)
    method: ClassVar[Newton] = Newton(solver=IN_SPACE)  # subclasses may override

    def __post_init__(self) -> None:
        check_materials(self.materials, 3)
        for name, material in self.materials.items():
            if material.current_density != 0.0:
                raise ValueError(
                    f"{name!r} has a current density, {material.current_density:g} A/m^2, which has no direction in "
                    "space: give the current as a Coil in coils, or its field as applied_field."
                )
        if not isinstance(self.potential, Mapping | None):
            raise ValueError(f"potential must map names of boundaries to phi in A; got {self.potential!r}.")
        checked_field(self.applied_field)
        # Copies, so that later changes by the caller do not alter a solved problem.
        object.__setattr__(self, "materials", dict(self.materials))
        object.__setattr__(self, "potential", dict(self.potential or {}))
        object.__setattr__(self, "symmetry", checked_symmetry(self.symmetry))
        object.__setattr__(self, "coils", checked_coils(self.coils))

    @property
    def free_field(self) -> AppliedField | None:
        return sources_of(self.coils, self.applied_field)

    def given_on(self, mesh: MeshTet, order: int = 1) -> tuple[Coefficients, dict[str, Mirror]]:
        kinds = (MeshTet1, MeshTet2)[:order]
        if type(mesh) not in kinds:
            plane = " Plane meshes are for Magnetostatics." if len(getattr(mesh, "p", ())) == 2 else ""
            wanted, found = " or ".join(kind.__name__.removesuffix("1") for kind in kinds), type(mesh).__name__
            straight = f" Set order=2 for curved edges, or k{remedy_for(mesh, True)[1:]}" * (found == "MeshTet2")
            raise ValueError(f"mesh must be a skfem.{wanted}; got {found}.{plane}{straight}")
        check_mesh(mesh, curved=True, space=True)
        mesh = corners_of(mesh)
        material, planes = coefficients(mesh, self.materials), mirrors_of(mesh, self.symmetry or {})
        if self.coils:
            check_placement(mesh, permeable(material) | material.coercivity.any(axis=0), self.coils, planes)
        return material, planes

    def conditions(self, drive: Drive, mirrors: Mapping[str, Mirror]) -> Conditions:
        """Return the conditions on u, the reduced potential, in iron the total one.

        A connected part without a given value has a first node that is neither fixed nor free, because u is determined
        there up to a constant only.
        """
        elements, mesh, potential = drive.elements, drive.elements.corners, self.potential or {}
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

    def conditions_of(self, field: LocalSolid) -> Conditions:
        if "conditions" not in field.kept:
            field.kept["conditions"] = self.conditions(field.drive, field.planes)
        return field.kept["conditions"]


def solved(start: SolidKind, unknown: Floats, steps: tuple[NewtonStep, ...] = ()) -> SolidKind:
    result = replace(start, unknown=unknown, newton=steps)
    refuse_unconverged(result)
    return result


ASYMMETRY = 0.01  # allowed asymmetric part of the applied field on a plane, relative to the largest


def _check_field(drive: Drive, name: str, mirror: Mirror) -> None:
    if drive.function is None:
        return
    mesh = drive.elements.corners
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
