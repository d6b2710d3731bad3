"""Polish random bodies and problems of order 2 in space, and count what is lost."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skfem import Basis, BilinearForm, ElementTetP2, LinearForm, MeshTet, condense, solve
from skfem.helpers import dot, grad

import kohonen_adapt as ka
from benchmarks.checks.coils import certificates
from benchmarks.peers.space_remeshing import volumes
from benchmarks.problems.coil_devices import random_blocks, random_media
from benchmarks.table import aligned
from kohonen_adapt.magnetostatics import MagneticScalarPotential

PROBLEMS, BODIES, QUICK = 200, 5000, 20
FLOOR = 0.2
ROUNDING = 1e-11
TOPOLOGIES = ("fixed", "flip", "recycle")


class Diffusion:
    """``-div(c grad u) = 1`` with a constant c in each half of a body, zero on a part of the boundary."""

    order = 2

    def __init__(self, seed: int) -> None:
        self.coefficient = 10.0 ** np.random.default_rng(seed).uniform(-2.0, 2.0, 2)

    def parts(self, mesh: MeshTet) -> tuple[np.ndarray, np.ndarray]:
        """Number of the half of every element, and the mask of the given unknowns."""
        region = np.isin(np.arange(mesh.nelements), mesh.subdomains["right"]).astype(int)
        basis = Basis(mesh, ElementTetP2(), intorder=2)
        fixed = np.zeros(basis.N, dtype=bool)
        fixed[basis.get_dofs("given").flatten()] = True
        return region, fixed

    def solve(self, mesh: MeshTet) -> np.ndarray:
        region, fixed = self.parts(mesh)
        basis, c = Basis(mesh, ElementTetP2(), intorder=2), self.coefficient[region][:, None]
        matrix = BilinearForm(lambda u, v, w: c * dot(grad(u), grad(v))).assemble(basis)
        load = LinearForm(lambda v, w: v).assemble(basis)
        return solve(*condense(matrix, load, D=np.flatnonzero(fixed)))

    def indicators(self, mesh: MeshTet, u: np.ndarray) -> np.ndarray:
        return np.ones(mesh.nelements)

    def ritz(self, mesh: MeshTet, u: np.ndarray) -> ka.Ritz:
        region, fixed = self.parts(mesh)
        return ka.Ritz(u, fixed, self.coefficient, source=1.0, region=region, order=2)

    def value(self, mesh: MeshTet) -> float:
        """The functional of the solution, half of its work with the opposite sign."""
        u = self.solve(mesh)
        return -0.5 * float(LinearForm(lambda v, w: v).assemble(Basis(mesh, ElementTetP2(), intorder=2)) @ u)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Certificates of random magnets and steel, then what random bodies lose."""
    return "\n\n".join(
        [certificates(QUICK if quick else PROBLEMS, magnets, order=2), losses(QUICK if quick else BODIES)]
    )


def magnets(seed: int) -> tuple[MeshTet, MagneticScalarPotential]:
    rng = np.random.default_rng(seed)
    materials, potential = random_media(rng)
    driven = potential | {"z-": 0.0, "z+": 10.0 ** rng.uniform(2.0, 5.0)}  # in A, so that no field is zero
    return random_blocks(seed, 4), MagneticScalarPotential(materials, driven, order=2)


def losses(count: int) -> str:
    """How many of so many bodies had a larger functional, other volumes or names, or worse elements after a polish."""
    lost = dict.fromkeys(("functional", "volume", "surface", "names", "quality", "input", "error"), 0)
    for seed in range(count):
        for name in lost_by(seed):
            lost[name] += 1
    return aligned(["random bodies", *lost], [[f"{count} (target 0)", *lost.values()]])


def lost_by(seed: int) -> Iterator[str]:
    mesh, problem = body(seed), Diffusion(seed)
    given = mesh.p.tobytes(), mesh.t.tobytes()
    try:
        polished = moved(mesh, problem, seed)
    except Exception:  # each is a loss
        yield "error"
        return
    before, after = problem.value(mesh), problem.value(polished)
    if after > before + ROUNDING * abs(before):
        yield "functional"
    if any(changed(volume(mesh, name), volume(polished, name)) for name in mesh.subdomains):
        yield "volume"
    if any(changed(surface(mesh, name), surface(polished, name)) for name in mesh.boundaries):
        yield "surface"
    if [*mesh.subdomains, *mesh.boundaries] != [*polished.subdomains, *polished.boundaries]:
        yield "names"
    if ka.quality(polished).min() < min(FLOOR, ka.quality(mesh).min()) * (1.0 - 1e-9):
        yield "quality"
    if (mesh.p.tobytes(), mesh.t.tobytes()) != given:
        yield "input"


def moved(mesh: MeshTet, problem: Diffusion, seed: int) -> MeshTet:
    topology = TOPOLOGIES[seed % 3]
    if topology == "recycle":
        return ka.adapt(mesh, problem, passes=1, topology=topology, seed=seed).mesh
    return ka.polish(mesh, problem, topology=topology, sweeps=2)


def body(seed: int) -> MeshTet:
    """Some cells of a grid, sheared, with inner nodes moved at random and two subdomains."""
    rng = np.random.default_rng(seed)
    mesh = MeshTet.init_tensor(*(np.arange(rng.integers(3, 5), dtype=float) for _ in range(3)))
    cell = (np.floor(mesh.p[:, mesh.t].mean(axis=1)).T @ [16, 4, 1]).astype(int)
    gone = rng.random(64) < rng.uniform(0.0, 0.4)
    gone[0] = False
    mesh = mesh.remove_elements(np.flatnonzero(gone[cell]))
    middle = mesh.p[0, mesh.t].mean(axis=0)
    right = np.flatnonzero(middle > 1.0)
    p = mesh.p.copy()
    held = np.unique(np.append(mesh.facets[:, mesh.boundary_facets()], np.intersect1d(*sides(mesh, right))))
    free = np.setdiff1d(np.arange(mesh.nvertices), held)
    p[:, free] += rng.uniform(-0.15, 0.15, (3, free.size))
    shear = np.triu(rng.uniform(-0.5, 0.5, (3, 3)), 1) + np.diag(rng.uniform(0.5, 2.0, 3))
    facets = mesh.boundary_facets()
    share = facets[mesh.p[1, mesh.facets[:, facets]].max(axis=0) < 1e-9]
    mesh = MeshTet(shear @ p, mesh.t)
    names = {"right": right, "left": np.setdiff1d(np.arange(mesh.nelements), right)}
    return mesh.with_subdomains(names).with_boundaries(
        {"given": share if holds_all(mesh, share) else facets, "outer": facets}
    )


def holds_all(mesh: MeshTet, facets: np.ndarray) -> bool:
    """Whether every piece of a body, connected by nodes, has one of the facets."""
    start, end = mesh.edges
    graph = coo_array((np.ones(start.size), (start, end)), shape=(mesh.nvertices,) * 2)
    pieces, piece = connected_components(graph, directed=False)
    return np.unique(piece[mesh.facets[:, facets]]).size == pieces


def sides(mesh: MeshTet, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of both halves."""
    return np.unique(mesh.t[:, right]), np.unique(np.delete(mesh.t, right, axis=1))


def volume(mesh: MeshTet, name: str) -> float:
    return float(volumes(mesh)[mesh.subdomains[name]].sum())


def surface(mesh: MeshTet, name: str) -> float:
    a, b, c = np.moveaxis(mesh.p[:, mesh.facets[:, np.asarray(mesh.boundaries[name])]], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a, axis=0), axis=0).sum() / 2.0)


def changed(before: float, after: float) -> bool:
    return abs(after - before) > ROUNDING * max(before, 1.0)
