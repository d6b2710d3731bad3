"""A permanent magnet in an iron core with an air gap: adapt its Gmsh mesh, print a table, write files and a report."""

import argparse
from pathlib import Path

import numpy as np

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material
from kohonen_adapt.report import write_report

MESH = Path(__file__).with_name("c_core.msh")
PASSES = 4
# Corners of an element and middles of its sides, row by row, by barycentric coordinates: B is linear between them.
SIX = np.array([[1.0, 0.5, 0.0, 0.5, 0.0, 0.0], [0.0, 0.5, 1.0, 0.0, 0.5, 0.0], [0.0, 0.0, 0.0, 0.5, 0.5, 1.0]])

PROBLEM = Magnetostatics(
    {
        "iron": Material(permeability=1000.0),
        "magnet": Material(permeability=1.05, remanence=(0.0, 1.2)),
        "air": Material(),
    },
    potential={"outer": 0.0},
)


def adapt(callback=None, progress=None):
    """The problem on the mesh as Gmsh made it, and on the adapted one."""
    mesh = ka.read_mesh(MESH, scale=1e-3)  # drawn in millimetres
    before = ka.adapt(mesh, PROBLEM, passes=0)
    return before, ka.adapt(mesh, PROBLEM, passes=PASSES, callback=callback, progress=progress)


def write(result, folder):
    """The field for ParaView and the mesh for Gmsh."""
    field = result.solution
    ka.write_mesh(
        folder / "magnet.vtu",
        result.mesh,
        point_data={"A (Wb per m)": field.potential},
        cell_data={"B (T)": field.flux_density, "H (A per m)": field.field_strength, "indicator": result.indicators},
    )
    ka.write_mesh(folder / "magnet.msh", result.mesh)


def draw(before, after, folder):
    """Meshes, indicators, flux lines and the estimate over the passes; a report to look into with a browser."""
    from kohonen_adapt.plotting import adaptation_figure  # needs matplotlib, the rest does not

    potential = after.solution.potential_at_each(SIX)
    figure = adaptation_figure(
        before,
        after,
        potential=potential,
        magnitude=np.hypot(*after.solution.at_each(SIX).flux_density).reshape(potential.shape),
        magnitude_label="flux density |B| (T)",
        indicator_label="error indicator of an element, $\\sqrt{\\mathrm{J/m}}$",
        lines_title="Flux lines",
        unit="mm",
    )
    figure.savefig(folder / "magnet.png")
    write_report(
        folder / "magnet.html",
        after,
        before=before,
        title="A magnet in an iron core",
        point_data={"vector potential A (Wb/m)": lambda field: field.potential},
        cell_data={"flux density |B| (T)": lambda field: np.hypot(*field.at_corners.flux_density).reshape(3, -1)},
        indicator_label="error indicator of an element (√(J/m))",
        unit="mm",
        pictures={"Meshes, error indicators, flux lines and estimate": folder / "magnet.png"},
        settings={"Program": Path(__file__).read_text(encoding="utf-8")},
    )


def main(folder="."):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    before, after = adapt()
    print(after)
    write(after, folder)
    draw(before, after, folder)
    return before, after


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    main(parser.parse_args().out)
