"""Corners of a solution, for layers of elements and for messages."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Ints
from kohonen_adapt.checks import point_text
from kohonen_adapt.loop.passes import Status
from kohonen_adapt.mesh.cells import TETRAHEDRON, TRIANGLE, cell_of
from kohonen_adapt.mesh.corners import corner_exponents, singular_nodes
from kohonen_adapt.mesh.singular_edges import singular_edges
from kohonen_adapt.problem.evaluation import ritz_of
from kohonen_adapt.problem.protocol import CheckedProblem
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.singular_nodes import materials_of

TOLD = 0.35  # exponent below which a corner is named; half the error takes elements 7 times smaller there
SHOWN = 3  # corners named
ROUNDING = 1e-16  # size of the least elements, relative to the mesh
SEEN = 1e-3  # least relative error that is named

LIMITED = (Status.MAX_PASSES, Status.MAX_NODES, Status.STALLED, Status.NOT_MOVED)


def singular_parts(problem: CheckedProblem, mesh: Mesh, solution: Any) -> tuple[Ints, Ints | None]:
    """Return the nodes at which a field is singular, and in space the edges (2, k).

    Raises NotOffered if the problem has neither these nor a functional.
    """
    in_space = cell_of(mesh) is TETRAHEDRON
    own = "singular_edges" if in_space else "singular_nodes"
    if problem.has(own):
        found = getattr(problem, own)(mesh, solution)
    else:
        materials = materials_of(mesh, ritz_of(problem, mesh, solution))
        found = (singular_edges if in_space else singular_nodes)(mesh, materials)
    if not in_space:
        return np.asarray(found), None
    edges, nodes = found
    return np.asarray(nodes), np.asarray(edges)


def corner_remark(status: Status, problem: CheckedProblem, mesh: Mesh, ritz: Ritz | None) -> str:
    if status not in LIMITED or cell_of(mesh) is not TRIANGLE:
        return ""
    if problem.has("corner_exponents"):
        exponents = dict(problem.corner_exponents(mesh))
    elif ritz is None:
        return ""
    else:
        exponents = dict(zip(*corner_exponents(mesh, materials_of(mesh, ritz)), strict=True))
    return " ".join(corner_sentences(mesh, exponents))


def corner_sentences(mesh: Mesh, exponents: Mapping[int, float]) -> list[str]:
    strong = sorted((exponent, node) for node, exponent in exponents.items() if exponent < TOLD)
    sentences = []
    for exponent, node in strong[:SHOWN]:
        smaller, energy = 2.0 ** (1.0 / exponent), ROUNDING ** (2.0 * exponent)
        least = np.sqrt(2.0 * energy / (1.0 - energy))
        limit = f", and elements of {ROUNDING:g} times the size of the mesh leave about {100.0 * least:.2g} %"
        sentences.append(
            f"The corner at {point_text(mesh.p[:, node])} has the exponent {exponent:.3g}: half the error there takes "
            f"elements {smaller:.2g} times smaller{limit if least > SEEN else ''}."
        )
    if (more := len(strong) - SHOWN) > 0:
        sentences.append(f"{more} more corners have exponents below {TOLD}.")
    return sentences
