"""Bounds of the inductance of a closed torus of iron, whose chords cut off a share of the section.

The inductance of the round torus is that of the finest mesh, with the share of its iron that chords cut off added. The
bounds hold on the polyhedron of a mesh, and for the round torus up to its own share.
"""

import numpy as np
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.checks.bracket import MESHES, WIDTHS, adapted, bracketed, inductance
from benchmarks.peers.space_remeshing import volumes
from benchmarks.problems.torus import RADIUS, SECTION, mesh, problem
from benchmarks.table import Cell, aligned

CHORDS = {3_500: 16, 15_000: 24}  # around the section, by nodes
FINEST, FINEST_NODES = 40, 30_000
STEP = 0.01  # largest elements of iron in m
VOLUME = np.pi**2 * RADIUS * SECTION**2  # of the half


def report(quick: bool) -> str:
    exact = reference(CHORDS[15_000], 15_000) if quick else reference(FINEST, FINEST_NODES)
    rows: list[list[Cell]] = []
    for nodes in list(WIDTHS)[: 1 if quick else None]:
        found = adapted(mesh(CHORDS[nodes], STEP), problem(), nodes)
        (low, high), solid = inductance(found), found.scalar.mesh
        width = 2.0 * (high - low) / (high + low)
        rows.append([CHORDS[nodes], solid.nvertices, low, high, width, WIDTHS[nodes], share(solid), exact])
    count = 5 if quick else MESHES
    held = sum(holds(exact, random_mesh(seed)) for seed in range(count))
    header = ["torus: chords", "nodes", "lower", "upper", "width", "target", "cut off", "round, uH"]
    return f"{aligned(header, rows)}\nUp to the share cut off, the bounds hold it on {held} of {count} coarse meshes."


def reference(chords: int, nodes: int) -> float:
    fine = adapted(mesh(chords, STEP), problem(), nodes)
    return float(np.mean(inductance(fine))) * (1.0 + share(fine.scalar.mesh))


def share(solid: MeshTet) -> float:
    return float(1.0 - volumes(solid)[solid.subdomains["iron"]].sum() / VOLUME)


def holds(exact: float, solid: MeshTet) -> bool:
    low, high = inductance(bracketed(problem(), solid))
    return low <= exact and exact * (1.0 - share(solid)) <= high


def random_mesh(seed: int) -> MeshTet:
    """A coarse mesh with other chords and sizes for every seed, every fifth of them adapted."""
    random = np.random.default_rng(seed)
    solid = mesh(int(random.integers(8, 16)), STEP, random.uniform(0.03, 0.06))
    return ka.adapt(solid, problem(), passes=1, seed=seed).mesh if seed % 5 == 0 else solid
