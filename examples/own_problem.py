"""Adapt scikit-fem's example 22, -div grad u = 1 on an L with u = 0 on its boundary, at a constant number of nodes.

A class with two methods is all that `adapt` needs of a problem; here are the two that it can use besides.
"""

import argparse
from pathlib import Path

import numpy as np
from skfem import Basis, ElementTriP1, MeshTri, condense, solve
from skfem.models.poisson import laplace, unit_load

import kohonen_adapt as ka


class Poisson:
    """Two methods make a problem. The third gives the table its error in per cent, the fourth lets nodes go down it."""

    calibrated = True  # by recovery the estimate is the error, give or take 10 %; without this it is an "indicator"

    def solve(self, mesh):
        basis = Basis(mesh, ElementTriP1())
        return solve(*condense(laplace.assemble(basis), unit_load.assemble(basis), D=mesh.boundary_nodes()))

    def indicators(self, mesh, solution):
        one = np.ones(mesh.t.shape[1])
        return ka.estimators.recovery(mesh, solution, one, source=one)

    def energy_norm(self, mesh, solution):
        return np.sqrt(unit_load.assemble(Basis(mesh, ElementTriP1())) @ solution)

    def ritz(self, mesh, solution):
        fixed = np.isin(np.arange(mesh.p.shape[1]), mesh.boundary_nodes())
        return ka.Ritz(solution, fixed, coefficient=1.0, source=1.0)


def draw(result, path):
    """The meshes, contours of the solution, and the estimate over the passes."""
    from matplotlib.figure import Figure

    from kohonen_adapt.plotting import draw_field_lines, draw_mesh, draw_passes  # these need it, the rest does not

    figure = Figure(figsize=(14.0, 3.4), dpi=80, layout="constrained")
    before, after, contours, passes = figure.subplots(1, 4)
    draw_mesh(before, result.history[0].mesh, unit="")
    draw_mesh(after, result.mesh, unit="")
    slope = Basis(result.mesh, ElementTriP1()).interpolate(result.solution).grad[:, :, 0]
    colours = draw_field_lines(contours, result.mesh, result.solution, np.hypot(*slope), unit="")
    figure.colorbar(colours, ax=contours, label="|grad u|", extend="max")
    draw_passes(passes, result.history)
    for axes, title in ((before, "Mesh before"), (after, "Mesh after"), (contours, "Contours of u")):
        axes.set_title(title)
    figure.savefig(path)


def main(folder="."):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    result = ka.adapt(MeshTri.init_lshaped().refined(4), Poisson(), passes=4)
    print(result)
    draw(result, folder / "own_problem.png")
    return result


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    main(parser.parse_args().out)
