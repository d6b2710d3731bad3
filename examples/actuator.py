"""A plunger actuator around an axis, its iron saturating: force against gap on adapted meshes, a table and a figure.

The force is checked by the energy. At constant current the plunger's work is the gain of co-energy W': F = dW'/dgap, so
the force that is integrated from the largest to the smallest gap must be the difference of W' there, though one is told
by the field in the air around the plunger and the other by the whole field.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Froehlich, Magnetostatics, Material

GAPS = np.array([1, 2, 3, 4, 5])  # mm, a mesh for each
# Corners of an element and middles of its sides, row by row, by barycentric coordinates: B is linear between them.
SIX = np.array([[1.0, 0.5, 0.0, 0.5, 0.0, 0.0], [0.0, 0.5, 1.0, 0.0, 0.5, 0.0], [0.0, 0.0, 0.0, 0.5, 0.5, 1.0]])
IRON, AIR = Material(bh=Froehlich(permeability=2000.0, saturation=1.9)), Material()

PROBLEM = Magnetostatics(
    {"core": IRON, "plunger": IRON, "coil": AIR, "air": AIR},
    potential={"outer": 0.0},
    ampere_turns={"coil": 1500.0},
    axisymmetric=True,
)


def pull(field):
    """Force on the plunger along the axis, in N; negative into the core."""
    return field.force("plunger")[1]


def adapted(gap):
    """The result for one gap in mm; its history begins with the mesh as Gmsh made it."""
    mesh = ka.read_mesh(Path(__file__).with_name(f"actuator_{gap}.msh"), scale=1e-3)  # drawn in millimetres
    return ka.adapt(mesh, PROBLEM, passes=1, outputs={"force (N)": pull})


def forces(results):
    """Forces in N of the meshes as they were and of the adapted ones, (2, ngaps)."""
    return np.array([[r.history[0].outputs["force (N)"], pull(r.solution)] for r in results]).T


def work(force):
    """Of the force from the largest gap to the smallest, in J: by a spline through F times gap over ln gap."""
    return float(CubicSpline(np.log(GAPS), force * GAPS * 1e-3).integrate(*np.log(GAPS[[-1, 0]])))


def draw(result, force, fine, path):
    """Mesh before and after and flux lines at the smallest gap; force over gap, and how far it is off."""
    from matplotlib.figure import Figure  # needs matplotlib, the rest does not

    from kohonen_adapt.plotting import draw_field_lines, draw_mesh

    figure = Figure(figsize=(18.0, 7.5), dpi=80, layout="constrained")
    panels = figure.subplot_mosaic("ABCF;ABCE", width_ratios=(1, 1, 1.15, 1))
    for key, word, mesh in (("A", "before", result.history[0].mesh), ("B", "after", result.mesh)):
        draw_mesh(panels[key], mesh, unit="mm")
        panels[key].set_title(f"Mesh {word}: {mesh.nvertices} nodes")
    at, potential, lines = result.solution.at_each(SIX), result.solution.potential_at_each(SIX), panels["C"]
    flux, size = at.x[0].reshape(potential.shape) * potential, np.hypot(*at.flux_density).reshape(potential.shape)
    colours = draw_field_lines(lines, result.mesh, flux, size, lines=15, unit="mm")
    figure.colorbar(colours, ax=lines, label="flux density |B| (T)", extend="max", aspect=40)
    lines.set_title("Flux lines after")
    for key in "ABC":
        panels[key].set(xlim=(-1, 31), ylim=(-25, 35), xlabel="r (mm)", ylabel="z (mm)")
    for values, label, mark in zip(force, ("Gmsh's meshes", "the same, adapted"), ("s--", "o-"), strict=True):
        panels["F"].plot(GAPS, -values, mark, label=label, markersize=5)
        panels["E"].plot(GAPS, 100 * (values / fine - 1), mark, label=label, markersize=5)
    panels["F"].set(title="Pull on the plunger", xlabel="gap (mm)", ylabel="force (N)", ylim=(0, None))
    panels["E"].set(title="Off order 3 on the adapted meshes", xlabel="gap (mm)", ylabel="difference (%)")
    panels["E"].axhline(0.0, color="black", linewidth=0.5)
    for key in "FE":
        panels[key].legend()
        panels[key].set_xticks(GAPS)
    figure.savefig(path)


def main(folder="."):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    results, better = [adapted(gap) for gap in GAPS], replace(PROBLEM, order=3)
    force, fine = forces(results), np.array([pull(better.solve(result.mesh)) for result in results])
    print(results[0])
    print("\ngap (mm)  force (N) before    after       of order 3")
    for row in zip(GAPS, *force, fine, strict=True):
        print("{:8d}  {:16.2f} {:8.2f} {:16.2f}".format(*row))
    gain = results[0].solution.coenergy - results[-1].solution.coenergy
    print(f"work of the force {work(force[1]):.5f} J, gain of co-energy {gain:.5f} J: {work(force[1]) / gain - 1:+.2%}")
    draw(results[0], force, fine, folder / "actuator.png")
    return results, force, fine


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    main(parser.parse_args().out)
