"""A thin circular layer, by a density of nodes alone and with the directions of the solution."""

import argparse
from pathlib import Path

import numpy as np
from skfem import Basis, BilinearForm, ElementTriP1, LinearForm, MeshTri, condense, solve
from skfem.helpers import dot, grad

import kohonen_adapt as ka

STEEPNESS, RADIUS = 60.0, 0.25  # u = tanh(60 (r - 1/4)), with r from the centre of the unit square


def distance(x):
    return np.hypot(x[0] - 0.5, x[1] - 0.5)


def source(x):
    """-div grad u."""
    r = np.maximum(distance(x), 1e-9)
    u, decay = np.tanh(STEEPNESS * (r - RADIUS)), np.cosh(STEEPNESS * (r - RADIUS)) ** -2
    return 2 * STEEPNESS**2 * decay * u - STEEPNESS * decay / r


@BilinearForm
def stiffness(u, v, _):
    return dot(grad(u), grad(v))


@LinearForm
def load(v, w):
    return source(w.x) * v


class Layer:
    """-div grad u = f in the unit square, u = 1 on its boundary up to 1e-12."""

    calibrated = True  # the recovery estimate is near the error

    def solve(self, mesh):
        basis, rim = Basis(mesh, ElementTriP1(), intorder=8), mesh.boundary_nodes()
        values = np.where(np.isin(np.arange(mesh.nvertices), rim), 1.0, 0.0)
        return solve(*condense(stiffness.assemble(basis), load.assemble(basis), x=values, D=rim))

    def indicators(self, mesh, solution):
        centres = mesh.p[:, mesh.t].mean(axis=1)
        return ka.estimators.recovery(mesh, solution, np.ones(mesh.nelements), source=source(centres))

    def energy_norm(self, mesh, solution):
        return np.sqrt(solution @ stiffness.assemble(Basis(mesh, ElementTriP1())) @ solution)

    def ritz(self, mesh, solution):
        """The functional int |grad u|^2 / 2 - f u that the solution minimises, for the polish."""
        rim = np.isin(np.arange(mesh.nvertices), mesh.boundary_nodes())
        return ka.Ritz(solution, rim, coefficient=1.0, source=lambda x, region: source(x))

    def error(self, mesh, solution):
        """|u - u_h|_1 relative to |u|_1 by quadrature."""
        basis = Basis(mesh, ElementTriP1(), intorder=10)
        x = np.asarray(basis.global_coordinates())
        slope = STEEPNESS * np.cosh(STEEPNESS * (distance(x) - RADIUS)) ** -2 / np.maximum(distance(x), 1e-9)
        exact = slope * (x - 0.5)
        off = basis.interpolate(solution).grad - exact
        return np.sqrt(np.sum(np.sum(off**2, axis=0) * basis.dx) / np.sum(np.sum(exact**2, axis=0) * basis.dx))


def draw(results, path):
    """The quarter x, y < 1/2 of the meshes."""
    import matplotlib.pyplot as plt  # the rest does not need it

    from kohonen_adapt.plotting import draw_mesh

    figure, axes = plt.subplots(1, len(results), figsize=(4.0 * len(results), 4.2), layout="constrained")
    for panel, (title, mesh, error) in zip(axes, results, strict=True):
        draw_mesh(panel, mesh, unit="")
        panel.set(xlim=(0.0, 0.5), ylim=(0.0, 0.5), title=f"{title}: error {100 * error:.1f} %")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main(folder="."):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    mesh, problem = MeshTri().refined(5), Layer()
    by_density = ka.adapt(mesh, problem, anisotropic=False).mesh
    by_metric = ka.adapt(mesh, problem).mesh
    results = [
        (title, each, problem.error(each, problem.solve(each)))
        for title, each in (("uniform", mesh), ("by density", by_density), ("with directions", by_metric))
    ]
    for title, each, error in results:
        print(f"{title}: {each.nvertices} nodes, error {100 * error:.1f} %")
    draw(results, folder / "layer.png")
    return results


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    main(parser.parse_args().out)
