"""Reasons for which the polish holds nodes that rules let slide or move."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from kohonen_adapt.arrays import Mask
from kohonen_adapt.geometry.held_nodes import names_at, of_boundaries
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, INSIDE, ON_RIDGE, PLANE
from kohonen_adapt.kernels.triangle.arrays import FREE
from kohonen_adapt.kernels.triangle.arrays import HELD as HELD_IN_PLANE
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional

__all__ = [
    "counted",
    "held_by_polish",
    "held_by_polish_in_space",
    "polish_reasons",
    "polish_reasons_in_space",
]


SHOWN = 3  # reasons in a message


def held_by_polish(movable: MovableMesh, functional: Functional) -> Mask:
    held = functional.kinds(movable.outline, functional.solution.fixed) == HELD_IN_PLANE
    moved = functional.chords.moving(movable.triangulation)
    return held & (movable.constraints.kind != HELD_IN_PLANE) & ~moved


def polish_reasons(movable: MovableMesh, functional: Functional) -> list[str]:
    found = [""] * movable.nnodes
    for v in np.flatnonzero(held_by_polish(movable, functional)).tolist():
        if movable.constraints.kind[v] == FREE:
            found[v] = "Dirichlet value inside the mesh"
            continue
        c = movable.constraints.own_chain[v]
        found[v] = reason_on_segment(movable, functional, c).format(names_at(movable, v, np.array([c])))
    return found


def counted(reasons: Sequence[str]) -> str:
    # in words, with the number of nodes by reason
    counts = Counter(filter(None, reasons)).most_common()
    if not counts:
        return "the admissible functions depend on the mesh"
    shown = [f"{count} node{'' if count == 1 else 's'} ({reason})" for reason, count in counts[:SHOWN]]
    others = sum(count for _, count in counts[SHOWN:])
    return f"the polish held {', '.join([*shown, *[f'{others} nodes for other reasons'] * (others > 0)])}"


# The braces stand for the names of the segment.
def reason_on_segment(movable: MovableMesh, functional: Functional, c: int) -> str:
    if any(part.boundary.on[c] for part, _ in functional.parts(functional.solution)):
        return "open {} (Robin condition)"
    names_of_pairs = [name for names in functional.ritz.signs for name in names]
    if functional.sign[c] == 0.0 and any(movable.outline.names[name][c] for name in names_of_pairs):
        return "periodic condition on {} without a matched boundary"
    if movable.constraints.chains.paired[c]:
        return "periodic pair on {}"
    if movable.outline.straight[c]:
        whose = "" if functional.dirichlet[c] and not functional.linear[c] else " of the dual solution"
        return f"Dirichlet values{whose} that are not linear along {{}}"
    if functional.chords.cut[c]:
        return "source that ends at the curve of {}"
    return f"curve of {{}}, where the polish moves no node {case_of(functional)}"


def case_of(functional: Functional) -> str:
    ritz = functional.ritz
    if ritz.order > 1:
        return f"at order {ritz.order}"
    if ritz.axisymmetric:
        return "around an axis"
    if any(ritz.laws):
        return "with a nonlinear law"
    if callable(ritz.source) or callable(ritz.flux):
        return "with a varying source or flux"
    return "with periodic boundaries" if ritz.signs else "with these Dirichlet values"


def held_by_polish_in_space(movable: MovableSolid, functional: SolidFunctional) -> Mask:
    solution = functional.solution
    held = functional.freedom(movable.freedom, solution.fixed, solution.surface).number == HELD
    return held & (movable.freedom.number != HELD)


def polish_reasons_in_space(movable: MovableSolid, functional: SolidFunctional) -> list[str]:
    freedom = movable.freedom
    found = [""] * movable.nnodes
    for v in np.flatnonzero(held_by_polish_in_space(movable, functional)).tolist():
        if freedom.number[v] == INSIDE:
            found[v] = "Dirichlet value inside the mesh"
            continue
        on_edge = freedom.number[v] == ON_RIDGE
        patches = movable.surfaces.meets[freedom.place[v]] if on_edge else freedom.place[[v]]
        patches = patches[patches >= 0]
        place = ("edge" if on_edge else "face") + of_boundaries(movable, patches)
        row = freedom.place[v] + functional.patches * on_edge
        uncounted = (movable.surfaces.shape[patches] != PLANE) & ~functional.faces.counted[patches]
        if functional.solution.surface[v : v + 1].any():
            found[v] = f"{place} on which an applied field drives the potential"
        elif uncounted.any():
            found[v] = f"curved {place} on which the polish moves no node"
        elif functional.held[row] and not functional.dirichlet[row]:
            found[v] = f"{place} beside a face that holds its nodes"
        else:
            found[v] = f"Dirichlet values that are not linear on the {place}"
    return found
