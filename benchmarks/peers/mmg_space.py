"""Remesh tetrahedra by Mmg3d, until the number of nodes is that of the start."""

import numpy as np
from skfem import MeshTet

from benchmarks.problems.solids import ON, Solid

GRADATION = 2.0
LOOPS = 5
TRIALS = 6  # of the last loop, 2 of the others: Mmg takes sizes and no number of nodes
NEAR = 1.02  # times the number of nodes, or less
EDGE = 1.1  # times rho^(-1/3): the length that Mmg is asked for at first


def mmg_adapted(problem: Solid, mesh: MeshTet) -> MeshTet:
    """The mesh after loops of solving, estimating and remeshing; density and estimate are those of `problem`."""
    count, correction = mesh.nvertices, 1.0
    for loop in range(LOOPS):
        u, _ = problem.solve(mesh)
        density = at_nodes(mesh, problem.density(mesh, u)) * count / mesh.nvertices
        for _ in range(TRIALS if loop == LOOPS - 1 else 2):
            found = remeshed(problem, mesh, EDGE * (density * correction) ** (-1 / 3))
            ratio = found.nvertices / count
            correction /= ratio
            if max(ratio, 1 / ratio) < NEAR:
                break
        mesh = found
    return mesh


def at_nodes(mesh: MeshTet, values: np.ndarray) -> np.ndarray:
    """Averages of values of elements by their volume, at nodes."""
    a, b, c, d = mesh.p[:, mesh.t].transpose(1, 0, 2)
    volume = np.abs(np.einsum("ij,ij->j", b - a, np.cross(c - a, d - a, axis=0)))
    total = np.bincount(mesh.t.ravel(), np.tile(volume, 4))
    return np.bincount(mesh.t.ravel(), np.tile(volume * values, 4)) / total


def remeshed(problem: Solid, mesh: MeshTet, sizes: np.ndarray) -> MeshTet:
    """One call, with edge lengths at the nodes."""
    from mmgpy import MmgMesh3D

    mmg = MmgMesh3D()
    mmg.set_mesh_size(vertices=mesh.nvertices, tetrahedra=mesh.nelements)
    mmg.set_vertices(np.ascontiguousarray(mesh.p.T))
    regions = np.ones(mesh.nelements, dtype=np.int64)
    for number, rows in enumerate((mesh.subdomains or {}).values()):
        regions[rows] = 2 + number
    mmg.set_tetrahedra(oriented(mesh), regions)
    mmg.set_field("metric", np.ascontiguousarray(sizes[:, None]))
    mmg.remesh(hgrad=GRADATION, verbose=-1)
    p = np.array(mmg.get_vertices())
    planes = np.round(4.0 * p) / 4.0  # which Mmg keeps up to rounding
    p = np.where(np.abs(p - planes) < ON, planes, p)
    return problem.named(MeshTet(np.ascontiguousarray(p.T), np.array(mmg.get_tetrahedra(), dtype=np.int64).T.copy()))


def oriented(mesh: MeshTet) -> np.ndarray:
    """Elements of positive volume, (nelements, 4)."""
    a, b, c, d = mesh.p[:, mesh.t].transpose(1, 0, 2)
    t = np.ascontiguousarray(mesh.t.T, dtype=np.int32)
    turned = np.einsum("ij,ij->j", b - a, np.cross(c - a, d - a, axis=0)) < 0
    t[turned, 2], t[turned, 3] = t[turned, 3], t[turned, 2].copy()
    return t
