"""Poisson's equation on the Fichera corner: tetrahedra go to its edges and corner, and the error falls to 35 %."""

import argparse
from pathlib import Path

import numpy as np
from skfem import Basis, ElementTetP1, MeshTet, condense, solve
from skfem.models.poisson import laplace, unit_load

import kohonen_adapt as ka

NORM_SQUARED = 0.3979433  # int |grad u|^2 of the exact solution, by extrapolation from elements of second order
PLANE = ka.Plane(point=(0.0, 0.0, -0.05), normal=(0.0, 0.0, 1.0))  # just below the faces that meet in the corner


class Poisson:
    """-div grad u = 1 and u = 0 around: two methods make a problem, the third lets its mesh be polished."""

    def solve(self, mesh):
        basis = Basis(mesh, ElementTetP1())
        return solve(*condense(laplace.assemble(basis), unit_load.assemble(basis), D=mesh.boundary_nodes()))

    def indicators(self, mesh, solution):
        ones = np.ones(mesh.t.shape[1])
        return ka.estimators.residual(mesh, solution, ones, source=ones)

    def ritz(self, mesh, solution):
        fixed = np.isin(np.arange(mesh.p.shape[1]), mesh.boundary_nodes())
        return ka.Ritz(solution, fixed, coefficient=1.0, source=1.0, flux=0.0)


def start_mesh(cubes=5):
    """(-1, 1)^3 without the octant where x, y and z are positive, in that many cubes per unit."""
    cube = MeshTet.init_tensor(*[np.linspace(-1, 1, 2 * cubes + 1)] * 3)
    inside = np.all(cube.p[:, cube.t].mean(axis=1) > 0, axis=0)
    mesh = cube.remove_elements(np.flatnonzero(inside))
    return mesh.with_boundaries({"corner": lambda x: np.all(x > -1e-9, axis=0)})


def error_of(step):
    """|u - u_h|_1 of a pass: the functional of its solution is minus half the square of |u_h|_1."""
    return np.sqrt(NORM_SQUARED + 2.0 * step.functional)


def draw(steps, path):
    """From outside and in a cut, before and after, on one scale of indicators."""
    from matplotlib.figure import Figure  # needed for the picture only

    from kohonen_adapt.plotting import indicator_scale, plot_slice, plot_surface

    norm = indicator_scale(*(step.indicators for step in steps))
    figure = Figure(figsize=(11.0, 9.0), dpi=160, layout="constrained")
    panels = figure.subplots(2, 2)
    for word, step, column in zip(("before", "after"), steps, panels.T, strict=True):
        values = step.indicators
        plot_surface(step.mesh, values, view=(65.0, 25.0), norm=norm, label="indicator", ax=column[0], unit="")
        plot_slice(step.mesh, PLANE, values, norm=norm, label="indicator", ax=column[1], unit="")
        column[0].set_title(f"{word}: {step.mesh.nvertices} nodes, error {error_of(step):.4f}")
    figure.savefig(path)


def main(folder="."):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    result = ka.adapt(start_mesh(), Poisson())
    print(result)
    first, best = result.history[0], result.best
    print(f"exact error: {error_of(first):.4f} before, {error_of(best):.4f} after")
    ka.write_mesh(folder / "fichera.msh", result.mesh)
    point, cell = {"u": result.solution}, {"indicator": result.indicators}
    ka.write_mesh(folder / "fichera.vtu", result.mesh, point_data=point, cell_data=cell)
    draw([first, best], folder / "fichera.png")
    return result


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    main(parser.parse_args().out)
