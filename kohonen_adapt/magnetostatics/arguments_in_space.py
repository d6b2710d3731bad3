"""Arguments that both potentials in space take, and their checks."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from skfem import MeshTet
from skfem.mesh import MeshTet1, MeshTet2

from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.coils.placement import check_placement, checked_coils
from kohonen_adapt.magnetostatics.equations.applied_field import permeable
from kohonen_adapt.magnetostatics.equations.conditions import Value
from kohonen_adapt.magnetostatics.equations.given_field import AppliedField, checked_field, sources_of
from kohonen_adapt.magnetostatics.equations.symmetry import Mirror, checked_symmetry, mirrors_of
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients, coefficients
from kohonen_adapt.magnetostatics.materials.material import Material, check_materials
from kohonen_adapt.mesh.cells import remedy_for
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["ArgumentsInSpace"]


@dataclass(frozen=True, eq=False)
class ArgumentsInSpace:
    materials: Mapping[str, Material]
    potential: Mapping[str, Value] | None = None
    applied_field: Any = None
    symmetry: Mapping[str, str] | None = None
    coils: Mapping[str, Coil] | None = field(default=None, kw_only=True)

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
