"""Warnings about lengths and materials that look like another unit."""

from collections.abc import Iterator

import numpy as np
from skfem import Mesh

from kohonen_adapt.cases.contents import Case
from kohonen_adapt.magnetostatics.materials.coefficients import coefficients, magnitude
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.problem import Magnetostatics
from kohonen_adapt.mesh.curved import corners_of

__all__ = ["case_doubts", "size_text", "unit_doubts"]

LARGE, SMALL = 2.0, 2e-5  # m: devices in millimetres are larger, and smaller with the scale of another unit
LEAST_PERMEABILITY = 0.999  # diamagnetic metals have more
MOST_REMANENCE = 3.0  # T: magnets have at most 1.5
MOST_MILLITESLA = 3000.0  # larger values are in gauss
LEAST_CURRENT_DENSITY = 100.0  # A/m^2: windings have about 10^6, which is 1 A/mm^2
LONG = 20.0  # m


def size_text(mesh: Mesh) -> str:
    return f"{' x '.join(f'{size:.4g}' for size in np.ptp(mesh.p, axis=1))} m"


def unit_doubts(mesh: Mesh, scale: float = 1.0) -> Iterator[str]:
    """Yield a warning if a mesh in metres is too large or too small for a device."""
    extent, size = np.ptp(mesh.p, axis=1).max(), size_text(mesh)
    if extent > LARGE and scale == 1.0:
        yield f"the mesh is {size}: that looks like millimetres. If so, --scale 1e-3 (scale = 1e-3 in a case)."
    elif extent > LARGE or extent < SMALL:
        which = "large" if extent > LARGE else "small"
        yield (
            f"the mesh is {size}: a scale of {scale:g} looks too {which}. The scale is metres per unit of the file: "
            "1 for m, 1e-3 for mm, 1e-6 for um."
        )


def case_doubts(case: Case, mesh: Mesh) -> Iterator[str]:
    yield from unit_doubts(mesh, case.scale)
    problem, corners = case.problem, corners_of(mesh)
    given = coefficients(corners, problem.materials)
    remanence = magnitude(given.remanence)
    for index, (name, material) in enumerate(problem.materials.items()):
        if material.permeability < LEAST_PERMEABILITY:
            yield permeability_doubt(name, material.permeability)
        largest = remanence[given.material_index == index].max(initial=0.0)
        if material.coercivity is None and largest > MOST_REMANENCE:
            unit, factor = ("mT", 1e3) if largest <= MOST_MILLITESLA else ("gauss", 1e4)
            yield (
                f"remanence of '{name}' is {largest:.6g} T, more than any magnet has: that looks like {unit}. If so, "
                f"write {largest / factor:.6g}."
            )
        if 0.0 < abs(material.current_density) < LEAST_CURRENT_DENSITY:
            yield (
                f"current_density of '{name}' is {material.current_density:g} A/m^2: that looks like A/mm^2. If so, "
                f"write {material.current_density:g}e6."
            )
    depth = problem.depth if isinstance(problem, Magnetostatics) else None
    if depth is not None and depth > LONG:
        yield f"depth is {depth:g} m: that looks like millimetres. If so, write {depth / 1e3:g}."


def permeability_doubt(name: str, permeability: float) -> str:
    start = f"permeability of '{name}' is relative, 1 for air; {permeability:.5g} "
    if permeability < 0.1:
        relative = permeability / VACUUM_PERMEABILITY
        return f"{start}looks like H/m. If so, write {relative:.4g} (divide by 4 pi 1e-7)."
    return f"{start}is below 1, as in superconductors only."
