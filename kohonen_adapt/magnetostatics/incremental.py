"""How the flux linkage of a circuit follows its current at a solution."""

from collections.abc import Mapping

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.conditions import Boundaries
from kohonen_adapt.magnetostatics.equations.newton import whole_step
from kohonen_adapt.magnetostatics.equations.system import loads
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.linkage import checked_circuit, turn_length, turns_density
from kohonen_adapt.magnetostatics.quantities.quadratic_field import QuadraticField
from kohonen_adapt.magnetostatics.solution import tangent_solution

__all__ = ["linkage_slope"]


def linkage_slope(field: Field, boundaries: Boundaries, circuit: Mapping[str, float]) -> float:
    """d linkage / d current of a circuit, everything else as it is; see `Magnetostatics.incremental_inductance`."""
    density = turns_density(field, checked_circuit(circuit))
    if isinstance(field, QuadraticField):
        linked, change = _quadratic(field, density)
    else:
        none = np.zeros((2, density.size))
        linked = loads(field.mesh, density, none)
        change = tangent_solution(field, boundaries, field.symmetry.source(density), none)
    return turn_length(field) * float(linked @ change)


def _quadratic(field: QuadraticField, density: Floats) -> tuple[Floats, Floats]:
    """What a density of turns is linked with, and what its current changes: (nnodes + nfacets,) each."""
    linked, free = field.problem.loads(density), field.problem.conditions.free
    return linked, whole_step(field.problem, field.values, -linked[free])
