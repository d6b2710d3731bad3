"""Model a coil around an axis, alone and with an iron core, and its error in the energy norm by its functional."""

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material

BOX, SQUARES = 4.0, 4  # its width and half of its height in m, and squares in a metre
# The minimum of the functional over 2 pi mu0 J^2, without and with the core: by quadratic elements for A on bisected
# meshes of 60 000 unknowns and more, extrapolated; cubic ones come down to 3e-10 below it, counted in, and 3e-8 above.
MINIMUM = {False: -0.2213125209, True: -0.7260801931}
DENSITY = 1e6  # A/m^2
UNIT = 2.0 * np.pi * 4e-7 * np.pi * DENSITY**2


def start(iron: bool) -> MeshTri:
    """Squares of a quarter of a metre, halved; the coil is at 0.5 < r < 1.5, |z| < 1, the core at r < 0.25, |z| < 2."""
    up = np.linspace(-BOX, BOX, round(2 * BOX * SQUARES) + 1)
    mesh = MeshTri.init_tensor(up[up >= 0.0], up)
    r, z = mesh.p[:, mesh.t].mean(axis=1)
    coil, core = (r > 0.5) & (r < 1.5) & (np.abs(z) < 1.0), iron & (r < 0.25) & (np.abs(z) < 2.0)
    parts = {"coil": coil, "air": ~coil & ~core} | ({"iron": core} if iron else {})
    mesh = mesh.with_subdomains({name: np.flatnonzero(inside) for name, inside in parts.items()})
    return mesh.with_boundaries({"far": lambda x: (x[0] > 0.999 * BOX) | (np.abs(x[1]) > 0.999 * BOX)})


def problem(iron: bool, order: int) -> Magnetostatics:
    """Air around it to A = 0 on the box."""
    materials = {"coil": Material(current_density=DENSITY), "air": Material()}
    materials |= {"iron": Material(permeability=1000.0)} if iron else {}
    return Magnetostatics(materials, potential={"far": 0.0}, axisymmetric=True, order=order)


def norm(iron: bool) -> float:
    """Of the field in the energy norm, in sqrt(J)."""
    return float(np.sqrt(-2.0 * MINIMUM[iron] * UNIT))


def error(mesh: MeshTri, iron: bool, order: int) -> float:
    """Of the solution on a mesh, by energy, in %."""
    value = ka.adapt(mesh, problem(iron, order), passes=0).best.functional / UNIT
    return 100.0 * float(np.sqrt(max(value / -MINIMUM[iron] + 1.0, 0.0)))
