"""Magnetostatic problems, materials, fields and goals in the plane and in space."""

from kohonen_adapt.magnetostatics.bracketing import bracket
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.equations.newton import NewtonStep, NotConverged
from kohonen_adapt.magnetostatics.hypercircle import Bracket
from kohonen_adapt.magnetostatics.materials.bh_table import Table, read_bh
from kohonen_adapt.magnetostatics.materials.laws import Arctan, Brauer, Froehlich, Law
from kohonen_adapt.magnetostatics.materials.material import Material, halbach, radial
from kohonen_adapt.magnetostatics.problem import Magnetostatics
from kohonen_adapt.magnetostatics.quantities.deprecated import (
    apparent_inductance,
    arkkio_torque,
    circuit_current,
    energy_inductance,
    lorentz_torque,
)
from kohonen_adapt.magnetostatics.quantities.edge_field import EdgeField
from kohonen_adapt.magnetostatics.quantities.field import CubicField, Field, HighOrderField, QuadraticField
from kohonen_adapt.magnetostatics.quantities.flux_density_at import FluxDensityAt
from kohonen_adapt.magnetostatics.quantities.forces import lorentz_force
from kohonen_adapt.magnetostatics.quantities.goals import FluxLinkage, Force, Goal, StoredEnergy, Torque
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.magnetostatics.scalar_potential import MagneticScalarPotential
from kohonen_adapt.magnetostatics.vector_potential import MagneticVectorPotential

__all__ = [
    "Arctan",
    "Bracket",
    "Brauer",
    "Coil",
    "CubicField",
    "EdgeField",
    "Field",
    "FluxDensityAt",
    "FluxLinkage",
    "Force",
    "Froehlich",
    "Goal",
    "HighOrderField",
    "Law",
    "MagneticScalarPotential",
    "MagneticVectorPotential",
    "Magnetostatics",
    "Material",
    "NewtonStep",
    "NotConverged",
    "QuadraticField",
    "SolidField",
    "StoredEnergy",
    "Table",
    "Torque",
    "apparent_inductance",
    "arkkio_torque",
    "bracket",
    "circuit_current",
    "energy_inductance",
    "halbach",
    "lorentz_force",
    "lorentz_torque",
    "radial",
    "read_bh",
]
