"""A pot magnet that grips a plate: a quarter of it in tetrahedra, and its force over the gap on adapted meshes."""

import argparse
from pathlib import Path

import numpy as np

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Froehlich, MagneticScalarPotential, Material

HERE = Path(__file__).parent
DRAWN = 1e-3  # m: the gap of the drawing
GAPS = (0.5e-3, 1e-3, 2e-3, 4e-3)
STEEL = Material(bh=Froehlich(permeability=2000.0, saturation=1.9))
PROBLEM = MagneticScalarPotential(
    {"magnet": Material(1.05, remanence=(0.0, 0.0, 1.3)), "pot": STEEL, "plate": STEEL, "air": Material()},
    potential={"far": 0.0},
    symmetry={"across x": "parallel", "across y": "parallel"},
)
CUT = ka.Plane(point=(0.0, 1e-4, 0.0), normal=(0.0, 1.0, 0.0))


def with_gap(mesh, gap):
    """The mesh with another gap: the nodes between pot and plate spread, and all below moved."""
    p = mesh.p.copy()
    p[2] -= (gap - DRAWN) * np.clip(-p[2] / DRAWN, 0.0, 1.0)
    return type(mesh)(p, mesh.t, mesh.boundaries, mesh.subdomains)


def pull(field):
    """On the whole plate, four times that on its quarter, in N."""
    return 4.0 * field.force("plate")[2]


def gripped(gap, passes=1):
    """Force on the plate by the mesh as it is drawn, and adapted with as many nodes."""
    start = with_gap(ka.read_mesh(HERE / "gripper.msh", scale=1e-3), gap)
    result = ka.adapt(start, PROBLEM, passes=passes, outputs={"force (N)": pull})
    return {
        "force as drawn (N)": result.history[0].outputs["force (N)"],
        "force adapted (N)": result.best.outputs["force (N)"],
        "energy adapted (J)": 4.0 * result.solution.energy,
        "nodes": result.mesh.nvertices,
    }


def draw(before, after, table, path):
    """|B| in the cut before and after, and the force over the gap."""
    from matplotlib.colors import Normalize  # needed for the picture only
    from matplotlib.figure import Figure

    from kohonen_adapt.plotting import plot_slice

    figure = Figure(figsize=(15.0, 5.0), dpi=160, layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    fields = {f"as drawn: {before.mesh.nvertices} nodes": before, f"adapted: {after.mesh.nvertices} nodes": after}
    sizes = [np.linalg.norm(field.flux_density, axis=0) for field in fields.values()]
    shared = Normalize(0.0, max(size.max() for size in sizes))
    for (title, field), size, axes in zip(fields.items(), sizes, (left, middle), strict=True):
        plot_slice(field.mesh, CUT, values=size, label="|B| (T)", norm=shared, ax=axes, unit="mm")
        axes.set(xlim=(0.0, 25.0), ylim=(-12.0, 15.0), title=title)
    for name, style in (("force as drawn (N)", "o--"), ("force adapted (N)", "o-")):
        right.plot(1e3 * table["gap"], table[name], style, label=name.removesuffix(" (N)"))
    right.set(xlabel="gap (mm)", ylabel="force on the plate (N)", ylim=(0.0, None))
    right.legend()
    figure.savefig(path)


def main(folder=".", gaps=GAPS, passes=1):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    found = ka.sweep(gripped, [{"gap": gap, "passes": passes} for gap in gaps])
    found.to_csv(folder / "gripper.csv")
    for row in found.table:
        drawn, adapted = row["force as drawn (N)"], row["force adapted (N)"]
        print(f"gap {1e3 * row['gap']:.1f} mm: {drawn:.2f} N, {adapted:.2f} N adapted")
    start = ka.read_mesh(HERE / "gripper.msh", scale=1e-3)
    before, after = PROBLEM.solve(start), ka.adapt(start, PROBLEM, passes=passes)
    print(after)
    ka.write_mesh(folder / "gripper.vtu", after.mesh, cell_data={"B (T)": after.solution.flux_density})
    draw(before, after.solution, found.table, folder / "gripper.png")
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    main(parser.parse_args().out)
