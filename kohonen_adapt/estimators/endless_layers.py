"""Squared errors of P1 solutions at corners with small exponents.

The elements at a node are divided by layers, each half the size of the last. In the plane the matrix of a layer does
not depend on its size, so that k doublings give 2^k layers. The finer functions contain those of the mesh, and their
solution has less energy by the square of the error at the corner.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask, ranks
from kohonen_adapt.estimators.discrete_flux import DiscreteFlux
from kohonen_adapt.mesh.corners import Materials, corner_exponents, fixed_parts
from kohonen_adapt.mesh.elements.exponents import STRONG
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.host import numbered, summed

__all__ = ["with_strong_corners"]

RATIO = 0.5  # of the sizes of successive layers
PIECES = 4  # of a side in a layer
DOUBLINGS = 14  # in 16384 layers the field of an exponent of 0.001 falls to 1e-5
CONTRAST = 3.0  # ratio of the coefficients around a node inside, below which no exponent is less than `STRONG`
FIXED = 10.0  # imbalance of a node with a prescribed value, relative to the largest of the nodes inside
ROUNDING = 1e-9  # the same, relative to the terms
SOLVED = 0.01  # imbalance around a corner, relative to the terms, up to which the potential counts as a solution


class System(NamedTuple):
    # Equations of a P1 solution.
    discrete: DiscreteFlux
    outflow: Floats  # (3, nelements): terms that balance at the nodes without a prescribed value
    fixed: Mask  # (nnodes,): nodes of the boundary that do not balance
    solved: Mask  # (nnodes,): nodes that balance, or are fixed

    @classmethod
    def of(cls, discrete: DiscreteFlux) -> "System":
        space, mesh, count = discrete.space, discrete.space.mesh, discrete.space.mesh.nvertices
        weights = space.volumes * discrete.reluctivity
        matrices = np.einsum("k,cik,cjk->ijk", weights, space.hats, space.hats)
        outflow = space.against_gradients(discrete.mean) - space.against_functions(discrete.source)
        terms = np.abs(matrices * discrete.potential[mesh.t]).sum(axis=1)
        total, scale = (summed(mesh.t, each, count) for each in (outflow, terms))
        imbalance, outer = np.abs(total), np.isin(np.arange(count), mesh.boundary_nodes())
        fixed = outer & (imbalance > FIXED * imbalance[~outer].max(initial=0.0) + ROUNDING * scale)
        return cls(discrete, outflow, fixed, fixed | (imbalance <= SOLVED * scale))


def with_strong_corners(indicators: Floats, discrete: DiscreteFlux) -> Floats:
    result, mesh = indicators, discrete.space.mesh
    among = contrasts(mesh, discrete.reluctivity)
    if not among.any():
        return result
    system = System.of(discrete)
    for node in strong_corners(system, among):
        at = np.any(mesh.t == node, axis=0)
        missing, own = missing_square(system, int(node), np.flatnonzero(at)), np.sum(indicators[at] ** 2)
        if missing > own:
            share = indicators[at] ** 2 / own if own > 0.0 else 1.0 / at.sum()
            result = result.copy()
            result[at] = np.maximum(result[at], np.sqrt(missing * share))
    return result


def contrasts(mesh: MeshTri, coefficient: Floats) -> Mask:
    low, high = np.full(mesh.nvertices, np.inf), np.zeros(mesh.nvertices)
    np.minimum.at(low, mesh.t, np.tile(coefficient, (3, 1)))
    np.maximum.at(high, mesh.t, np.tile(coefficient, (3, 1)))
    return high > CONTRAST * low


def strong_corners(system: System, among: Mask) -> Ints:
    mesh, coefficient = system.discrete.space.mesh, system.discrete.reluctivity
    kind = numbered(coefficient)
    materials = Materials(coefficient, kind, None, *fixed_parts(mesh, system.fixed, 1))
    strong, _ = corner_exponents(mesh, materials, STRONG, among)
    return strong[[bool(system.solved[mesh.t[:, np.any(mesh.t == node, axis=0)]].all()) for node in strong]]


def missing_square(system: System, node: int, star: Ints) -> float:
    # Return the squared error that layers without end in the elements `star` at a node remove.
    discrete, mesh, fixed = system.discrete, system.discrete.space.mesh, system.fixed
    nodes, local = np.unique(mesh.t[:, star], return_inverse=True)
    around, free = MeshTri(mesh.p[:, nodes], local.reshape(3, -1)), np.flatnonzero(~fixed[nodes] & (nodes != node))
    matrix, load, removed = endless_at(discrete, star, around, int(np.searchsorted(nodes, node)), free)
    change = summed(around.t, system.outflow[:, star])[free] + load
    rest, elsewhere = np.setdiff1d(np.flatnonzero(~fixed), node), discrete.reluctivity.copy()
    elsewhere[star] = 0.0
    at, right = np.searchsorted(rest, nodes[free]), np.zeros(rest.size)
    right[at] = change
    places = np.repeat(at, at.size), np.tile(at, at.size)
    layers = csc_array((matrix.ravel(), places), shape=(rest.size,) * 2)
    corrected = splu(discrete.space.stiffness(elsewhere, rest).matrix + layers).solve(right)
    return max(removed + float(change @ corrected[at]), 0.0)


def endless_at(
    discrete: DiscreteFlux, star: Ints, around: MeshTri, corner: int, free: Ints
) -> tuple[Floats, Floats, float]:
    # Return `endless` of the layers in the elements `star` at a corner, for the free nodes around the corner. `around`
    # is a mesh of these elements, and has the corner.
    space = Space(around, PIECES, arcs=False)  # with the nodes of the pieces
    sides = np.flatnonzero(np.all(around.facets != corner, axis=0))
    number = space.on_facets(sides)
    nodes = np.unique(number)
    index, total = ranks(nodes, space.doflocs.shape[1]), nodes.size
    along = index[number[[0, *range(2, PIECES + 1), 1]]]
    one, other = along[:-1], along[1:]
    # Two triangles of every piece, with nodes (3, 2, PIECES, n).
    triangles = np.reshape([[one, one], [other, other + total], [other + total, one + total]], (3, -1))
    position = space.doflocs[:, nodes] - around.p[:, [corner]]
    layer = Space(MeshTri(np.hstack((position, RATIO * position)), triangles), 1)
    element = star[np.tile(around.f2t[0, sides], 2 * PIECES)]
    matrix = layer.stiffness(discrete.reluctivity[element], np.arange(2 * total)).matrix.toarray()
    flux, source = -discrete.mean[:, element], discrete.source[element]
    loads = np.stack([layer.loads(0.0 * source, flux), layer.loads(source, 0.0 * flux)], axis=1)
    kept = np.flatnonzero((nodes >= around.nvertices) | np.isin(nodes, free))
    both = np.append(kept, kept + total)
    layers, load, removed = endless(matrix[np.ix_(both, both)], loads[both])
    trace = space.prolongation(index).toarray()[np.ix_(kept, index[free])]  # linear along sides
    return trace.T @ layers @ trace, trace.T @ load, removed


def endless(layer: Floats, loads: Floats) -> tuple[Floats, Floats, float]:
    # Return matrix and load of layers without end, for the nodes of the first, and a squared error.
    # The rows of a layer are its outer and its inner nodes. The columns of `loads` fall with the size and with the
    # area. The last value is the squared error that the layers remove while the nodes of the first keep their values.
    n, fall = len(layer) // 2, np.array([RATIO, RATIO**2])
    outer, across, inner = layer[:n, :n], layer[:n, n:], layer[n:, n:]
    matrix, through, end = outer, across, inner
    for _ in range(DOUBLINGS):
        to_outer, to_inner = np.hsplit(np.linalg.solve(end + matrix, np.hstack((through.T, through))), 2)
        matrix, end, through = matrix - through @ to_outer, end - through.T @ to_inner, -through @ to_inner
    matrix = matrix - through @ np.linalg.solve(end, through.T)
    # The first layer is followed by layers without end, which have the same load times `fall`.
    inverse = np.linalg.inv(inner + matrix)
    moved, parts = across @ inverse, loads[:n] - across @ inverse @ loads[n:]
    load = np.linalg.solve(np.eye(n) + fall[:, None, None] * moved, parts.T[:, :, None])[:, :, 0].T
    between = loads[n:] + fall * load
    removed = between.T @ inverse @ between / (1.0 - np.outer(fall, fall))
    return matrix, load.sum(axis=1), float(removed.sum())
