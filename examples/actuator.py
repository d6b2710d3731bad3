"""A plunger actuator with rounded edges, in the plane: adapt its Gmsh mesh, print a table, draw a figure."""

import sys
from pathlib import Path

import numpy as np

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material

MESH = Path(__file__).with_name("actuator.msh")

PROBLEM = Magnetostatics(
    {
        "core": Material(permeability=1000.0),
        "plunger": Material(permeability=1000.0),
        "coil": Material(current_density=4e6),
        "air": Material(),
    },
    potential={"outer": 0.0, "axis": 0.0},  # the other half carries the opposite current
)


def draw(before, after, path):
    """Mesh before and after, and flux lines over |B|, without the outer part of the air."""
    from matplotlib.figure import Figure  # needs matplotlib, the rest does not

    from kohonen_adapt.plotting import draw_field_lines, draw_mesh

    figure = Figure(figsize=(14.0, 8.0), dpi=160, layout="constrained")
    panels = figure.subplots(1, 3)
    for axes, word, result in zip(panels, ("before", "after"), (before, after), strict=False):
        draw_mesh(axes, result.mesh, unit="mm")
        axes.set_title(f"Mesh {word}: {result.mesh.p.shape[1]} nodes")
    mesh, field = after.mesh, after.solution
    colours = draw_field_lines(panels[2], mesh, field.potential, np.hypot(*field.flux_density), lines=12, unit="mm")
    figure.colorbar(colours, ax=panels[2], label="flux density |B| (T)", extend="max", aspect=40)
    panels[2].set_title("Flux lines after")
    for axes in panels:
        axes.set(xlim=(-1, 31), ylim=(-25, 35))
    figure.savefig(path)


def main(folder="."):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    mesh = ka.read_mesh(MESH, scale=1e-3)  # drawn in millimetres
    before, after = ka.adapt(mesh, PROBLEM, passes=0), ka.adapt(mesh, PROBLEM, passes=3)
    print(after)
    draw(before, after, folder / "actuator.png")
    return before, after


if __name__ == "__main__":
    main(*sys.argv[1:])
