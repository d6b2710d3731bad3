"""Linear magnetostatics in the plane: the vector potential A_z on a triangular mesh."""

from kohonen_adapt.magnetostatics.forces import arkkio_torque, lorentz_force, lorentz_torque
from kohonen_adapt.magnetostatics.material import Material
from kohonen_adapt.magnetostatics.problem import Magnetostatics

__all__ = ["Magnetostatics", "Material", "arkkio_torque", "lorentz_force", "lorentz_torque"]
