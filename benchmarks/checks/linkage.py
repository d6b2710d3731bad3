"""Measure inductances of coils in space against closed forms, the energy and finer solutions."""

from dataclasses import replace
from itertools import product

import numpy as np
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.problems.coil_devices import (
    AIR,
    electromagnet,
    electromagnet_problem,
    energy_beyond,
    gapped_ring,
    ring_problem,
)
from benchmarks.table import Cell, aligned
from kohonen_adapt.magnetostatics import Coil, FluxLinkage, MagneticScalarPotential, Material

PASSES = 5


def report(quick: bool) -> str:
    return "\n\n".join([in_air(), against_energy(3_000 if quick else 10_000), ring(2_500 if quick else 5_000)])


def in_air() -> str:
    """A Brooks coil, 1.6994e-6 H/m times its mean radius (Grover, Inductance Calculations, 1946)."""
    coil, line = Coil.circular((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.75, (0.5, 0.5), 1.0), np.linspace(-2.0, 2.0, 5)
    mesh = MeshTet.init_tensor(line, line, line).with_boundaries({"far": lambda x: np.abs(x).max(axis=0) > 1.9})
    mesh = mesh.with_subdomains({"air": np.arange(mesh.nelements)})
    field = MagneticScalarPotential({"air": AIR}, {"far": 0.0}, coils={"winding": coil}).solve(mesh)
    found, closed = field.inductance("winding"), 1.6994e-6 * 0.75
    header = ["thick coil in air", "inductance in uH", "published", "difference", "target"]
    return aligned(header, [["Brooks", 1e6 * found, 1e6 * closed, found / closed - 1.0, 0.001]])


def against_energy(nodes: int) -> str:
    """Linkage times current over twice the energy, with the energy of the coil's field beyond the mesh."""
    steel = dict.fromkeys(("yoke", "pole"), Material(1000.0))
    magnet = replace(electromagnet_problem(1000.0), materials=steel | {"air": AIR})
    cases = {
        "electromagnet": (electromagnet(1), magnet, (0.0, 0.0, 0.075)),
        "ring with a gap": (gapped_ring(1), ring_problem(), (0.05, 0.0, 0.0)),
    }
    rows: list[list[Cell]] = []
    for (name, (mesh, problem, centre)), order in product(cases.items(), (1, 2)):
        field = ka.adapt(mesh, replace(problem, order=order), passes=PASSES, target_nodes=nodes).solution
        coil = (problem.coils or {})["winding"]
        linked = coil.ampere_turns * field.flux_linkage("winding")
        twice = 2.0 * field.energy + energy_beyond(field.mesh, coil, centre)
        rows.append([name, order, field.mesh.nvertices, 4.0 * linked, 4.0 * twice, linked / twice - 1.0, 0.002])
    header = ["linear iron", "order", "nodes", "linkage times current in J", "twice the energy", "difference", "target"]
    return aligned(header, rows)


def ring(nodes: int) -> str:
    """Inductance of a ring with a gap for one turn, against order 2 on a mesh of 2.4 times as many nodes."""
    fine = ka.adapt(gapped_ring(1), ring_problem(), passes=PASSES, target_nodes=round(2.4 * nodes)).solution
    exact = 4.0 * fine.inductance("winding")
    rows: list[list[Cell]] = []
    for order, goal in product((1, 2), (None, FluxLinkage({"winding": 1}))):
        problem = replace(ring_problem(goal), order=order)
        field = ka.adapt(gapped_ring(1), problem, passes=PASSES, target_nodes=nodes).solution
        found = 4.0 * field.inductance("winding")
        told = replace(problem, goal=FluxLinkage({"winding": 1})).goal_error(field)
        corrected = found + 4.0 * told / 1000.0
        name = "energy" if goal is None else "linkage"
        rows.append(
            [name, order, nodes, 1e6 * found, found / exact - 1.0, 1e6 * corrected, corrected / exact - 1.0, 0.01]
        )
    header = ["ring adapted for", "order", "nodes", "inductance in uH", "error", "corrected", "error", "target"]
    return f"{aligned(header, rows)}\norder 2, {fine.mesh.nvertices} nodes: {1e6 * exact:.5g} uH"
