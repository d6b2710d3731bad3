"""Linear magnetostatics in the plane: the vector potential A_z on a triangular mesh."""

from kohonen_adapt.magnetostatics.forces import arkkio_torque, lorentz_force, lorentz_torque
from kohonen_adapt.magnetostatics.linkage import apparent_inductance, circuit_current, energy_inductance
from kohonen_adapt.magnetostatics.material import Material
from kohonen_adapt.magnetostatics.problem import Magnetostatics

__all__ = [
    "Magnetostatics",
    "Material",
    "apparent_inductance",
    "arkkio_torque",
    "circuit_current",
    "energy_inductance",
    "lorentz_force",
    "lorentz_torque",
]
