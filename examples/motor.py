"""One pole of a permanent-magnet machine, its sides antiperiodic: adapt its Gmsh mesh, print a table, draw a figure."""

import sys
from pathlib import Path

import numpy as np

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material

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


def sector(materials):
    """The problem of one pole: A on "left" is -A on "right"."""
    return Magnetostatics(materials, potential={"outer": 0.0, "inner": 0.0}, antiperiodic=[("right", "left")])


def draw(before, after, path):
    """Mesh before and after, and flux lines over |B|: the whole sector, and the gap at a slot opening."""
    from matplotlib.figure import Figure  # needs matplotlib, the rest does not

    from kohonen_adapt.plotting import draw_field_lines, draw_mesh

    figure = Figure(figsize=(14.0, 10.0), dpi=90, layout="constrained")
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
    problem = sector(MATERIALS)
    before = ka.adapt(mesh, problem, passes=0)
    after = ka.adapt(mesh, problem, passes=3, periodic=[("left", "right")], layers={"gap": 2})
    print(after)
    draw(before, after, folder / "motor.png")
    return before, after


if __name__ == "__main__":
    main(*sys.argv[1:])
