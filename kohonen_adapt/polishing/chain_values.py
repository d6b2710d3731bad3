"""Dirichlet values and periodic signs on curve segments."""

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats
from kohonen_adapt.geometry.plane.chains import on_chains
from kohonen_adapt.geometry.plane.outline import Outline
from kohonen_adapt.mesh.polynomials import TrialFunction
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.problem.ritz import Ritz

__all__ = ["hold_unpaired", "line_of_chains", "nodes_of_chains", "signs_of_chains"]


def hold_unpaired(solution: TrialFunction, ritz: Ritz, triangulation: Triangulation, outline: Outline) -> None:
    for name in (name for names in ritz.signs for name in names):
        sides = on_chains(triangulation.elements.chain, (outline.names[name] != 0) & ~outline.constraints.chains.paired)
        solution.fixed[np.concatenate(triangulation.elements.ends(*np.nonzero(sides)))] = True
        if solution.modes is not None:
            solution.modes.dirichlet[sides] = True


def signs_of_chains(ritz: Ritz, outline: Outline) -> Floats:
    sign, chains = np.zeros(len(outline.constraints.chains.length)), outline.constraints.chains
    for names, times in ritz.signs.items():
        for name in names:
            sign[(outline.names[name] != 0) & chains.paired] = times
    return sign


def nodes_of_chains(triangulation: Triangulation) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    elements = triangulation.elements
    e, k = np.nonzero(elements.chain >= 0)
    node = np.concatenate([elements.node[e, (k + 1) % 3], elements.node[e, (k + 2) % 3]])
    return np.tile(elements.chain[e, k], 2), node


def line_of_chains(
    triangulation: Triangulation, outline: Outline, chain: NDArray[np.int32], node: NDArray[np.int32], values: Floats
) -> tuple[Floats, Floats]:
    """Return linear functions (c, 2) on curve segments and deviations (c,) of values.

    A linear function is stored as the value at the start and the rate along the segment. The rate is 0 on curves.
    """
    chains = outline.constraints.chains
    offset = triangulation.position[node] - chains.origin[chain]
    parameter = np.sum(offset * chains.direction[chain], axis=1)
    order = np.lexsort((parameter, chain))
    last = np.cumsum(np.bincount(chain, minlength=len(chains.length))) - 1
    end, start = values[node[order[last]]], values[node[order[np.append(0, last[:-1] + 1)]]]
    rate = np.where(outline.straight, (end - start) / chains.length, 0.0)
    deviation = np.zeros(len(start))
    np.maximum.at(deviation, chain, np.abs(values[node] - start[chain] - rate[chain] * parameter))
    return np.stack([start, rate], axis=1), deviation
