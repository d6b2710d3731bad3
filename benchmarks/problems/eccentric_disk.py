"""Solve for the field of a magnetised disk off the middle of a box, on chords, with its error on the true disk."""

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from skfem import Basis, BilinearForm, ElementTriP0, ElementTriP2, LinearForm, MeshTri, MeshTri2, condense, solve
from skfem.helpers import dot, grad

import kohonen_adapt as ka
from benchmarks.problems import p1

CENTRE, RADIUS = np.array([0.45, 0.35]), 0.4  # in a box from -1 to 1
MAGNETISATION = -1.0  # nu Br, along y


def disk_mesh(size: float) -> MeshTri:
    """Gmsh's mesh with edges of about that length."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        box = gmsh.model.occ.addRectangle(-1.0, -1.0, 0.0, 2.0, 2.0)
        disk = gmsh.model.occ.addDisk(*CENTRE, 0.0, RADIUS, RADIUS)
        _, (rest, inside) = gmsh.model.occ.fragment([(2, box)], [(2, disk)])
        gmsh.model.occ.synchronize()
        parts = {"magnet": inside, "air": sorted(set(rest) - set(inside))}
        for name, entities in parts.items():
            gmsh.model.addPhysicalGroup(2, [tag for _, tag in entities], name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.model.mesh.generate(2)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "disk.msh")
            gmsh.write(str(path))
            return ka.read_mesh(path)
    finally:
        gmsh.finalize()


class EccentricDisk:
    """-div(nu grad u - g) = 0 with u = 0 on the box, nu of the disk a parameter."""

    def __init__(self, inside: float) -> None:
        self.inside = inside

    def constants(self, mesh: MeshTri) -> tuple[np.ndarray, np.ndarray]:
        """nu (nelements,) and g (2, nelements)."""
        magnet = np.isin(np.arange(mesh.t.shape[1]), mesh.subdomains["magnet"])
        return np.where(magnet, self.inside, 1.0), np.where(magnet, np.array([[MAGNETISATION], [0.0]]), 0.0)

    def solve(self, mesh: MeshTri) -> np.ndarray:
        """Nodal values on the polygons."""
        nu, flux = self.constants(mesh)
        load = p1.integrate_gradients(mesh, flux)
        return p1.solve_dirichlet(mesh, p1.stiffness(mesh, nu), load, np.zeros(load.size))

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """Residual indicators of the energy norm."""
        nu, flux = self.constants(mesh)
        return p1.residual_indicators(mesh, solution, nu, flux=flux)

    def ritz(self, mesh: MeshTri, solution: np.ndarray) -> ka.Ritz:
        """int nu |grad u|^2 / 2 - g . grad u."""
        region = np.isin(np.arange(mesh.t.shape[1]), mesh.subdomains["magnet"]).astype(int)
        flux = np.outer((MAGNETISATION, 0.0), (0.0, 1.0))
        return ka.Ritz(solution, p1.on_boundary(mesh), (1.0, self.inside), flux=flux, region=region)

    def functional(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """Of a solution on the true disk: around the inscribed polygon elements of air reach into it."""
        (nu, flux), slope = self.constants(mesh), p1.gradient(mesh, solution)
        magnet = np.isin(np.arange(mesh.t.shape[1]), mesh.subdomains["magnet"])
        one, other = mesh.f2t
        chords = np.flatnonzero((other >= 0) & (magnet[one] != magnet[other]))
        outside = np.where(magnet[one[chords]], other[chords], one[chords])
        start, end = mesh.p[:, mesh.facets[:, chords]].swapaxes(0, 1)
        angle = 2.0 * np.arcsin(np.hypot(*(end - start)) / (2.0 * RADIUS))
        sliver = 0.5 * RADIUS**2 * (angle - np.sin(angle))
        density = 0.5 * nu * np.sum(slope**2, axis=0) - np.sum(flux * slope, axis=0)
        inner = 0.5 * self.inside * np.sum(slope**2, axis=0) - MAGNETISATION * slope[0]
        return float(p1.area(mesh) @ density + sliver @ (inner - density)[outside])

    def error(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """In the energy norm, in per cent of it: the functional lies above its minimum by half the square."""
        exact = reference(self.inside)
        return 100.0 * float(np.sqrt((self.functional(mesh, solution) - exact) / -exact))


@cache
def reference(inside: float) -> float:
    """The least functional, by curved elements of order 2 at two sizes, extrapolated as h^4."""
    coarse, fine = (_least(disk_mesh(size), EccentricDisk(inside)) for size in (0.04, 0.02))
    return fine + (fine - coarse) / 15.0


def _least(mesh: MeshTri, problem: EccentricDisk) -> float:
    nu, flux = problem.constants(mesh)
    middle, magnet = mesh.p[:, mesh.facets].mean(axis=1), np.isin(np.arange(nu.size), mesh.subdomains["magnet"])
    chords = np.flatnonzero((mesh.f2t[1] >= 0) & (magnet[mesh.f2t[0]] != magnet[mesh.f2t[1]]))
    way = middle[:, chords] - CENTRE[:, None]
    middle[:, chords] = CENTRE[:, None] + RADIUS * way / np.hypot(*way)
    basis = Basis(MeshTri2(np.hstack((mesh.p, middle)), mesh.t), ElementTriP2(), intorder=6)
    constants = basis.with_element(ElementTriP0())
    matrix = BilinearForm(lambda u, v, w: w["nu"] * dot(grad(u), grad(v))).assemble(basis, nu=constants.interpolate(nu))
    load = LinearForm(lambda v, w: w["g"] * grad(v)[0]).assemble(basis, g=constants.interpolate(flux[0]))
    solution = solve(*condense(matrix, load, D=basis.get_dofs()))
    return float(0.5 * solution @ (matrix @ solution) - load @ solution)
