"""One pole of a permanent-magnet machine, its sides antiperiodic: adapt its Gmsh mesh, print a table, draw a figure."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
from scipy.sparse import csc_array
from scipy.spatial import cKDTree

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material
from kohonen_adapt.magnetostatics.coefficients import coefficients
from kohonen_adapt.magnetostatics.field import Field
from kohonen_adapt.magnetostatics.system import equations, fixed_values, solved

MESH = Path(__file__).with_name("motor.msh")
POLE = np.pi / 4  # angle of the sector, counter-clockwise from "right" to "left"
CURRENT = 4e6  # A/m^2, peak, at the instant when phase a has it and b and c half of it with the other sign

IRON, AIR = Material(permeability=1000.0), Material()
MATERIALS = {
    "stator": IRON,
    "rotor": IRON,
    "magnet": Material(permeability=1.05, remanence=(0.0, 1.2)),
    "coil_a_plus": Material(current_density=CURRENT),
    "coil_b_minus": Material(current_density=0.5 * CURRENT),
    "coil_c_minus": Material(current_density=0.5 * CURRENT),
    **dict.fromkeys(["slot_air", "gap", "rotor_air"], AIR),
}


class Sector(Magnetostatics):
    """Magnetostatics with A on "left" = -A on "right"; the jump of H across these sides is not in the indicators."""

    def solve(self, mesh):
        given = coefficients(mesh, self.materials)
        fixed, values = fixed_values(mesh, self.potential)
        matrix, right = equations(mesh, given, values, np.arange(values.size))
        eliminate = antiperiodic(mesh, fixed)
        free = solved((eliminate.T @ matrix @ eliminate).tocsc(), eliminate.T @ right)
        return Field(mesh, values + eliminate @ free, given.reluctivity, given.remanence, given.current_density)

    def ritz(self, mesh, field):
        """With the potential on the sides given, for the polish looks at one side at a time."""
        ritz = super().ritz(mesh, field)
        sides = np.union1d(*side_nodes(mesh))
        return dataclasses.replace(ritz, fixed=ritz.fixed | np.isin(np.arange(ritz.fixed.size), sides))


def side_nodes(mesh):
    """The nodes of "right", and of "left" those that they become by the rotation."""
    right, left = (np.unique(mesh.facets[:, mesh.boundaries[name]]) for name in ("right", "left"))
    z = mesh.p[0] + 1j * mesh.p[1]
    turned, there = z[right] * np.exp(1j * POLE), z[left]
    distance, partner = cKDTree(np.c_[there.real, there.imag]).query(np.c_[turned.real, turned.imag])
    if len(left) != len(right) or distance.max() > 1e-9 * np.ptp(mesh.p):
        raise ValueError(
            f"'left' must have the nodes of 'right', turned by {POLE:.4f} rad; it has {len(left)} for {len(right)}, up "
            f"to {distance.max():.1e} m apart. In Gmsh: Periodic Curve ... Rotate; in adapt: periodic or pinned sides."
        )
    return right, left[partner]


def antiperiodic(mesh, fixed):
    """The matrix that makes all nodal values, zero at the fixed nodes, of those that are free and not on "left"."""
    right, left = side_nodes(mesh)
    nodes = np.arange(fixed.size)
    master, sign = nodes.copy(), np.where(fixed, 0.0, 1.0)
    master[left], sign[left] = right, -sign[right]
    free = np.flatnonzero((master == nodes) & ~fixed)
    column = np.zeros(fixed.size, dtype=int)
    column[free] = np.arange(free.size)
    return csc_array((sign, (nodes, column[master])), shape=(fixed.size, free.size))


def draw(before, after, path):
    """Mesh before and after, and flux lines over |B|: the whole sector, and the gap at a slot opening."""
    from matplotlib.figure import Figure  # needs matplotlib, the rest does not

    from kohonen_adapt.plotting import draw_field_lines, draw_mesh

    figure = Figure(figsize=(14.0, 10.0), dpi=160, layout="constrained")
    panels = figure.subplots(2, 3)
    for row, place in zip(panels, ("", " at a slot opening"), strict=True):
        for axes, word, result in zip(row, ("before", "after"), (before, after), strict=False):
            draw_mesh(axes, result.mesh, unit="mm")
            axes.set_title(f"Mesh {word}{place or f': {result.mesh.p.shape[1]} nodes'}")
        field = after.solution
        colours = draw_field_lines(row[2], after.mesh, field.potential, np.hypot(*field.flux_density), unit="mm")
        row[2].set_title(f"Flux lines after{place}")
    for axes in panels[1]:
        axes.set(xlim=(8.5, 15.5), ylim=(40.5, 47.5))
    figure.colorbar(colours, ax=panels[:, 2], label="flux density |B| (T)", extend="max", aspect=50)
    figure.savefig(path)


def main(folder="."):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    mesh = ka.read_mesh(MESH, scale=1e-3)  # drawn in millimetres
    problem = Sector(MATERIALS, potential={"outer": 0.0, "inner": 0.0})
    before = ka.adapt(mesh, problem, passes=0)
    after = ka.adapt(mesh, problem, passes=3, pinned=("left", "right"))
    print(after)
    draw(before, after, folder / "motor.png")
    return before, after


if __name__ == "__main__":
    main(*sys.argv[1:])
