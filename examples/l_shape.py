"""Laplace's equation on the L-shape: the exact solution is known, so the error itself is seen to fall."""

import argparse
from pathlib import Path

import numpy as np
from skfem import Basis, ElementTriP1, FacetBasis, Functional, MeshTri, condense, solve
from skfem.helpers import dot
from skfem.models.poisson import laplace

import kohonen_adapt as ka

TURN = np.exp(-0.75j * np.pi)  # brings the middle of the L to the positive real axis, the branch cut outside
NORM_SQUARED = 1.8362266618751626  # int |grad u|^2 of the exact solution


def exact(x):
    """r^(2/3) sin(2 theta / 3) with the angle theta from the positive x-axis; x (2, ...)."""
    return ((TURN * (x[0] + 1j * x[1])) ** (2 / 3)).real


def exact_gradient(x):
    """Its gradient (2, ...)."""
    slope = 2 / 3 * TURN * (TURN * (x[0] + 1j * x[1])) ** (-1 / 3)
    return np.stack([slope.real, -slope.imag])


@Functional
def flow_times_solution(w):
    return dot(exact_gradient(w.x), w.n) * w["solution"]


class LShape:
    """div grad u = 0 with the exact values on the boundary."""

    calibrated = True  # the indicators come near the error itself, which the picture shows

    def solve(self, mesh):
        stiffness = laplace.assemble(Basis(mesh, ElementTriP1()))
        return solve(*condense(stiffness, x=exact(mesh.p), D=mesh.boundary_nodes()))

    def indicators(self, mesh, solution):
        return ka.estimators.recovery(mesh, solution, np.ones(mesh.t.shape[1]))

    def energy_norm(self, mesh, solution):
        return np.sqrt(solution @ laplace.assemble(Basis(mesh, ElementTriP1())) @ solution)

    def ritz(self, mesh, solution):
        """The functional int |grad u|^2 / 2 that the solution minimises, for the polish."""
        return ka.Ritz(solution, np.isin(np.arange(mesh.p.shape[1]), mesh.boundary_nodes()), coefficient=1.0)

    def error(self, mesh, solution):
        """|u - u_h|_1: u is harmonic, so int grad u . grad u_h is a smooth integral over the boundary."""
        basis = FacetBasis(mesh, ElementTriP1(), intorder=10)
        mixed = flow_times_solution.assemble(basis, solution=basis.interpolate(solution))
        return np.sqrt(NORM_SQUARED - 2 * mixed + self.energy_norm(mesh, solution) ** 2)


def start_mesh(squares=16):
    """(-1, 1)^2 without the quadrant x > 0 > y, in that many squares per unit."""
    ticks = np.linspace(-1, 1, 2 * squares + 1)
    square = MeshTri.init_tensor(ticks, ticks)
    x, y = square.p[:, square.t].mean(axis=1)
    return square.remove_elements(np.flatnonzero((x > 0) & (y < 0)))


def draw(before, after, errors, path):
    """Meshes, indicators, contours of the solution and the error over the passes."""
    from kohonen_adapt.plotting import adaptation_figure  # needs matplotlib, the rest does not

    gradient = Basis(after.mesh, ElementTriP1()).interpolate(after.solution).grad[:, :, 0]
    figure = adaptation_figure(
        before,
        after,
        potential=after.solution,
        magnitude=np.hypot(*gradient),
        magnitude_label="|grad u|",
        lines_title="Contours of u",
        unit="",
        errors=errors,
    )
    figure.savefig(path)


def main(folder="."):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    mesh, problem = start_mesh(), LShape()
    before, after = ka.adapt(mesh, problem, passes=0), ka.adapt(mesh, problem, passes=4)
    errors = [problem.error(step.mesh, problem.solve(step.mesh)) for step in after.history]
    print(after)
    print("exact error:", ", ".join(f"{error:.4f}" for error in errors))
    ka.write_mesh(
        folder / "l_shape.vtu",
        after.mesh,
        point_data={"u": after.solution},
        cell_data={"indicator": after.indicators},
    )
    draw(before, after, errors, folder / "l_shape.png")
    return after, errors


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    main(parser.parse_args().out)
