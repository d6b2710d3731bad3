"""Squared errors of P1 solutions at corners with small exponents.

The elements at a node are divided by layers, each half the size of the last. In the plane the matrix of a layer does
not depend on its size, so that k doublings give 2^k layers. The finer functions contain those of the mesh, and their
solution has less energy by the square of the error at the corner.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse.linalg import splu
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.estimators.discrete_flux import DiscreteFlux
from kohonen_adapt.mesh.corners import Materials, corner_exponents, fixed_parts
from kohonen_adapt.mesh.curved import AFTER, BEFORE
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
    mesh: MeshTri
    discrete: DiscreteFlux
    matrices: Floats  # (3, 3, nelements)
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
        return cls(mesh, discrete, matrices, outflow, fixed, fixed | (imbalance <= SOLVED * scale))

    def condensed(self, nodes: Ints) -> Floats:
        # Return the matrix of free nodes (n,) with all others eliminated, (n, n).
        free = np.flatnonzero(~self.fixed)
        matrix = self.discrete.space.stiffness(self.discrete.reluctivity, free).matrix
        inverse = splu(matrix).solve((free[:, None] == nodes).astype(np.float64))
        return np.linalg.inv(inverse[np.searchsorted(free, nodes)])


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
    mesh, coefficient = system.mesh, system.discrete.reluctivity
    kind = numbered(coefficient)
    materials = Materials(coefficient, kind, None, *fixed_parts(mesh, system.fixed, 1))
    strong, _ = corner_exponents(mesh, materials, STRONG, among)
    return strong[[bool(system.solved[mesh.t[:, np.any(mesh.t == node, axis=0)]].all()) for node in strong]]


def missing_square(system: System, node: int, star: Ints) -> float:
    # Return the squared error that layers without end in the elements `star` at a node remove.
    mesh, fixed = system.mesh, system.fixed
    ring = np.setdiff1d(mesh.t[:, star], node)
    free = np.flatnonzero(~fixed[ring])
    place = np.searchsorted(ring, mesh.t[:, star])
    place[mesh.t[:, star] == node] = ring.size
    own = np.zeros((ring.size + 1,) * 2)
    np.add.at(own, (place[:, None], place[None]), system.matrices[:, :, star])
    if not fixed[node]:
        own -= np.outer(own[:, -1], own[-1]) / own[-1, -1]
    outflow = summed(place, system.outflow[:, star], ring.size + 1)
    others = system.condensed(ring[free]) - own[np.ix_(free, free)]
    matrix, load, removed = endless_at(system, star, place, free)
    change = outflow[free] + load
    return max(removed + float(change @ np.linalg.solve(others + matrix, change)), 0.0)


def endless_at(system: System, star: Ints, place: Ints, free: Ints) -> tuple[Floats, Floats, float]:
    # Return `endless` of the layers in the elements `star` around a corner, for the free nodes around the corner.
    # `place` has numbers of the nodes of elements, (3, n): nodes around the corner, then the corner.
    count, corner = int(place.max()), system.mesh.p[:, system.mesh.t[:, star]]
    k, rows, steps = np.argmax(place, axis=0), np.arange(star.size), np.arange(PIECES + 1) / PIECES
    first, second = (place[np.take(ways, k), rows] for ways in (AFTER, BEFORE))
    a, b = (corner[:, np.take(ways, k), rows] - corner[:, k, rows] for ways in (AFTER, BEFORE))
    between = count + np.arange(star.size * (PIECES - 1)).reshape(PIECES - 1, -1)
    number = np.vstack((first, between, second))  # of the nodes along the sides, (PIECES + 1, n)
    total = count + between.size
    trace = np.zeros((total, count))  # linear along sides
    for at, share in zip(number, steps, strict=True):
        trace[at, first], trace[at, second] = 1.0 - share, share
    x = a[:, None] + steps[:, None] * (b - a)[:, None]
    one, other = number[:-1], number[1:]
    # Two triangles of every piece, with nodes (3, 2, PIECES, n) and corners (2, 3, 2, PIECES, n).
    triangles = np.reshape([[one, one], [other, other + total], [other + total, one + total]], (3, -1))
    position, discrete, every = np.empty((2, total)), system.discrete, 2 * PIECES
    position[:, number] = x
    layer = Space(MeshTri(np.hstack((position, RATIO * position)), triangles), 1)
    matrix = layer.stiffness(np.tile(discrete.reluctivity[star], every), np.arange(2 * total)).matrix.toarray()
    flux, source = (np.tile(each, every) for each in (-discrete.mean[:, star], discrete.source[star]))
    loads = np.stack([layer.loads(0.0 * source, flux), layer.loads(source, 0.0 * flux)], axis=1)
    kept = np.append(free, np.arange(count, total))
    both = np.append(kept, kept + total)
    layers, load, removed = endless(matrix[np.ix_(both, both)], loads[both])
    trace = trace[np.ix_(kept, free)]
    return trace.T @ layers @ trace, trace.T @ load, removed


def endless(layer: Floats, loads: Floats) -> tuple[Floats, Floats, float]:
    # Return matrix and load of layers without end, for the nodes of the first, and a squared error.
    # The rows of a layer are its outer and its inner nodes. The columns of `loads` fall with the size and with the
    # area. The last value is the squared error that the layers remove while the nodes of the first keep their values.
    n, fall, removed = len(layer) // 2, np.array([RATIO, RATIO**2]), np.zeros((2, 2))
    outer, across, inner, first, last = layer[:n, :n], layer[:n, n:], layer[n:, n:], loads[:n], loads[n:]
    for _ in range(DOUBLINGS):
        between = last + fall * first
        middle = np.linalg.solve(inner + outer, np.hstack((across.T, across, between)))
        to_outer, to_inner, by_load = middle[:, :n], middle[:, n : 2 * n], middle[:, 2 * n :]
        removed = removed + np.outer(fall, fall) * removed + between.T @ by_load
        first, last, fall = first - across @ by_load, fall * last - across.T @ by_load, fall**2
        outer, inner, across = outer - across @ to_outer, inner - across.T @ to_inner, -across @ to_inner
    middle = np.linalg.solve(inner, np.hstack((across.T, last.sum(axis=1, keepdims=True))))
    removed_in_all = float(removed.sum() + last.sum(axis=1) @ middle[:, n])
    return outer - across @ middle[:, :n], first.sum(axis=1) - across @ middle[:, n], removed_in_all
