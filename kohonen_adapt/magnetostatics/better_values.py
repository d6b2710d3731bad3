"""Better values of outputs and goals, for their errors."""

from collections.abc import Mapping

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.plane.arcs import refined_on_arcs
from kohonen_adapt.magnetostatics.arguments import Arguments
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.solution import richer_solution, solution_of
from kohonen_adapt.magnetostatics.strong_corners import layer_counts, layered, materials_of, strong_corners
from kohonen_adapt.mesh.corners import meetings, singular_nodes
from kohonen_adapt.mesh.curved import is_second_order
from kohonen_adapt.problem.evaluation import Output
from kohonen_adapt.problem.uncertain import Uncertain

__all__ = ["better_values"]

STRAIGHT, SHARPEST = 1e-3, 1.0  # turns between chords of an arc, approximately in radians
# Rest of the series of the changes by one order, over the last change, if the ratio of successive changes is a third.
REST = 0.5
MORE_ORDERS = 2  # at most, after the first


def better_values(problem: Arguments, field: Field, outputs: Mapping[str, Output]) -> dict[str, Uncertain]:
    """Return values of outputs by two or three orders more, and their doubts.

    Arcs are rounder, too. The outputs themselves are evaluated, because a derivative omits terms that are as large as
    the error on a mesh adapted for the output. One order more misses the rest of a series, and nearly all of an error
    whose sign changes from order to order. The doubt is `REST` times the change by the last order. A third order
    follows if a doubt is more than half the change by both (`python -m benchmarks effectivity`).

    Twice as many facets on arcs reduce the area between chords and arcs to a quarter, and between parabolas and arcs to
    a sixteenth. The difference of two solves, with and without rounder arcs, is extrapolated accordingly. Both are
    linearised at the field, because their errors of second order cancel.
    """

    def values_of(each: Field) -> Floats:
        return np.array([float(output(each)) for output in outputs.values()])

    better = better_solution(problem, field)
    values, before, doubts = values_of(better), values_of(field), np.full(len(outputs), np.inf)
    for _ in range(MORE_ORDERS):
        if np.all(doubts <= 0.5 * np.abs(values - before)):
            break
        better = richer_solution(problem, better, linearised=True)
        now = values_of(better)
        values, doubts = now, REST * np.abs(now - values)
    meshes, fraction = refined_on_arcs(field.mesh), 15.0 / 16.0 if is_second_order(field.mesh) else 0.75
    if meshes is not None and not (better.elements.arcs and is_second_order(field.mesh)):
        chords, arcs = (solution_of(problem, problem.energy_on(each, field.order), field, True) for each in meshes)
        values = values + (values_of(arcs) - values_of(chords)) / fraction
    return dict(zip(outputs, map(Uncertain, values, doubts), strict=True))


def better_solution(problem: Arguments, field: Field) -> Field:
    # Where the field is singular, the error falls by a power of the order only, and one order more removes a part.
    corners, exponent = strong_corners(problem, field)
    counts = layer_counts(field.mesh, corners, exponent)
    if not field.elements.arcs:
        others = np.setdiff1d(singular_nodes(field.mesh, materials_of(problem, field)), corners)
        corners, counts = np.append(corners, others), np.append(counts, np.ones_like(others))
    allowed = ~np.isin(corners, on_outer_arcs(field))
    mesh, layers = layered(problem, field.mesh, corners[allowed], counts[allowed])
    if layers:
        return solution_of(problem, problem.energy_on(mesh, field.order + 1), field)
    return richer_solution(problem, field)


def on_outer_arcs(field: Field) -> Ints:
    # Torques need an outer boundary whose nodes are on a circle, and layers divide its chords.
    mesh = field.elements.corners
    ends = mesh.facets[:, mesh.boundary_facets()]
    along = mesh.p[:, ends[1]] - mesh.p[:, ends[0]]
    along /= np.hypot(*along)
    meeting, turn = meetings(ends.ravel(), np.concatenate([along, -along], axis=1), mesh.nvertices)
    is_round = (meeting == 2) & (turn > STRAIGHT) & (turn < SHARPEST)
    return np.unique(ends[:, is_round[ends].any(axis=0)])
