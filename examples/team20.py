"""TEAM problem 20: the force on the pole of an electromagnet over the current, computed and measured."""

import argparse
from pathlib import Path

import numpy as np

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Coil, Force, MagneticScalarPotential, Material, read_bh

HERE = Path(__file__).parent
MEASURED = np.loadtxt(HERE / "team20_forces.csv", delimiter=",", skiprows=2)  # ampere-turns in A, force in N
STEEL, AIR = Material(bh=read_bh(HERE / "team20_bh.csv")), Material()


def problem(ampere_turns):
    bore, section = (0.039, 0.039), (0.018, 0.0966)
    coil = Coil.straight_limb((0.0, 0.0, 0.075), (0.0, 0.0, 1.0), bore, section, ampere_turns, radius=0.005)
    materials = {"yoke": STEEL, "pole": STEEL, "bore": AIR, "air": AIR}
    symmetry, goal = {"across x": "parallel", "across y": "parallel"}, Force("pole", (0.0, 0.0, -1.0))
    device = {"coils": {"winding": coil}, "symmetry": symmetry, "goal": goal}
    return MagneticScalarPotential(materials, {"far": 0.0}, **device)


def draw(field, coil, table, path):
    from matplotlib.colors import Normalize  # needed for the picture only
    from matplotlib.figure import Figure

    from kohonen_adapt.plotting import plot_slice

    figure = Figure(figsize=(9.0, 5.0), dpi=160, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.5))
    cut, size = ka.Plane((0.0, 1e-4, 0.0), (0.0, 1.0, 0.0)), np.linalg.norm(field.flux_density, axis=0)
    norm = Normalize(0.0, 2.4)
    plot_slice(field.mesh, cut, size, label="|B| (T)", norm=norm, coils=[coil], ax=left, unit="mm")
    left.set(xlim=(0.0, 90.0), ylim=(-15.0, 165.0), title=f"{coil.ampere_turns:.0f} A, {field.mesh.nvertices} nodes")
    right.errorbar(*table[:, :2].T, np.abs(table[:, 2]), fmt="o", capsize=4.0, label="computed, with estimated error")
    right.plot(*MEASURED.T, "kx", label="measured")
    right.set(xlabel="ampere-turns (A)", ylabel="force on the pole (N)", xlim=(0.0, 5500.0), ylim=(0.0, 90.0))
    right.legend(loc="upper left")
    figure.savefig(path)


def main(folder=".", currents=tuple(MEASURED[:, 0]), passes=None, goal_rtol=0.01):
    start, table = ka.read_mesh(HERE / "team20.msh", scale=1e-3), []
    Path(folder).mkdir(parents=True, exist_ok=True)
    for current in currents:
        result = ka.adapt(start, problem(current), passes=passes, goal_rtol=goal_rtol)
        force = result.outputs["goal"]  # on a quarter
        table.append([current, 4.0 * force.corrected, 4.0 * force.error])
        print("{:.0f} A: {:.2f} N, estimated error {:.2f} N".format(*table[-1]))
    draw(result.solution, problem(current).coils["winding"], np.array(table), Path(folder) / "team20.png")
    return result, np.array(table)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    parser.add_argument(
        "--goal-rtol", type=float, default=0.01, help="relative error of the force (default: %(default)s)"
    )
    given = parser.parse_args()
    main(given.out, goal_rtol=given.goal_rtol)
