"""Poisson's equation on the Fichera corner: tetrahedra go to its edges and corner, and the error falls."""

import argparse
from pathlib import Path

import numpy as np
from skfem import Basis, ElementTetP1, MeshTet, condense, solve
from skfem.models.poisson import laplace, unit_load

import kohonen_adapt as ka

NORM_SQUARED = 0.3979433  # int |grad u|^2 of the exact solution, by extrapolation from elements of second order
PLANE = ka.Plane(point=(0.0, 0.0, -0.05), normal=(0.0, 0.0, 1.0))  # just below the faces that meet in the corner


def start_mesh(cubes=5):
    """(-1, 1)^3 without the octant where x, y and z are positive, in that many cubes per unit."""
    cube = MeshTet.init_tensor(*[np.linspace(-1, 1, 2 * cubes + 1)] * 3)
    inside = np.all(cube.p[:, cube.t].mean(axis=1) > 0, axis=0)
    mesh = cube.remove_elements(np.flatnonzero(inside))
    return mesh.with_boundaries({"corner": lambda x: np.all(x > -1e-9, axis=0)})


def solved(mesh):
    """The solution of -div grad u = 1 that is 0 around, and its error |u - u_h|_1: u_h is the best there is."""
    basis = Basis(mesh, ElementTetP1())
    load = unit_load.assemble(basis)
    solution = solve(*condense(laplace.assemble(basis), load, D=mesh.boundary_nodes()))
    return solution, np.sqrt(NORM_SQUARED - load @ solution)


def indicators_of(mesh, solution):
    """The residual of each element and the jumps at its faces."""
    ones = np.ones(mesh.t.shape[1])
    return ka.estimators.residual(mesh, solution, ones, source=ones)


def draw(meshes, indicators, errors, path):
    """From outside and in a cut, before and after, on one scale of indicators."""
    from matplotlib.figure import Figure  # needed for the picture only

    from kohonen_adapt.plotting import indicator_scale, plot_slice, plot_surface

    figure, norm = Figure(figsize=(11.0, 9.0), dpi=160, layout="constrained"), indicator_scale(*indicators)
    panels = figure.subplots(2, 2)
    for word, mesh, values, error, column in zip(
        ("before", "after"), meshes, indicators, errors, panels.T, strict=True
    ):
        plot_surface(mesh, values, view=(65.0, 25.0), norm=norm, label="indicator", ax=column[0], unit="")
        plot_slice(mesh, PLANE, values, norm=norm, label="indicator", ax=column[1], unit="")
        column[0].set_title(f"{word}: {mesh.nvertices} nodes, error {error:.4f}")
    figure.savefig(path)


def main(folder=".", passes=6):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    meshes = [start_mesh()]
    solutions, errors = map(list, zip(solved(meshes[0]), strict=True))
    for number in range(passes):
        density = ka.density_from_indicators(meshes[-1], indicators_of(meshes[-1], solutions[-1]))
        meshes.append(ka.relocate(meshes[-1], density, topology="recycle", seed=number))
        solution, error = solved(meshes[-1])
        solutions.append(solution)
        errors.append(error)
        print(f"pass {number + 1}: {meshes[-1].nvertices} nodes, exact error {error:.4f}, {errors[0]:.4f} before")
    best = int(np.argmin(errors))
    indicators = [indicators_of(meshes[k], solutions[k]) for k in (0, best)]
    ka.write_mesh(folder / "fichera.msh", meshes[best])
    ka.write_mesh(
        folder / "fichera.vtu", meshes[best], point_data={"u": solutions[best]}, cell_data={"indicator": indicators[1]}
    )
    draw([meshes[0], meshes[best]], indicators, [errors[0], errors[best]], folder / "fichera.png")
    return meshes, errors


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    main(parser.parse_args().out)
