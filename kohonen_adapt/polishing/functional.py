"""Express a Ritz functional in terms of a movable mesh: constants by region, given values by chain."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.kernels.arrays import FREE, HELD, SLIDING, STRAIGHT, Laws, Trial
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.outline.outline import Outline
from kohonen_adapt.polishing.energy_tables import Tables, tabulated
from kohonen_adapt.problem.ritz import EnergyLaw, Ritz, check_fits, gradients

__all__ = ["Functional", "VariesInside"]

LINEAR = 1e-9  # of the range of all values: given values this near to a straight line between a chain's ends are on it


class VariesInside(ValueError):
    """The constants of a functional change inside a region of the mesh."""


@dataclass(frozen=True)
class Functional:
    """What the polish lowers: it holds for the triangulation as it is now, wherever its nodes and edges have gone.

    Attributes
    ----------
    values, fixed
        Nodal values of the solution, and whether they are given, (n,), on the mesh it was found on.
    constants
        Coefficient, source and flux of every region of the triangulation, (nregions, 4).
    given
        Chains whose values are given, (c,) bool.
    linear
        Of those, the ones on which the values are linear in arc length, so that nodes may slide on them, (c,) bool.
    held
        Chains whose nodes are not to slide: curves, given values that are not linear, or a chain of one facet between
        two nodes with given values, of which nobody can tell whether they are given on it, (c,) bool.
    on_chain
        Value at the origin of every chain and rate along it, (c, 2); true where `linear`.
    comparable
        Whether values of the functional on moved meshes may be compared: the admissible functions are the same, because
        outlines are straight, and values are given on whole chains only and linearly there.
    law
        Place of the law of every region in the tables, (nregions,) of int32; -1 where the region is linear.
    tables
        The energies of the laws.
    """

    values: Floats
    fixed: Mask
    constants: Floats
    given: Mask
    linear: Mask
    held: Mask
    on_chain: Floats
    comparable: bool
    law: NDArray[np.int32]
    tables: Tables

    @classmethod
    def of(cls, ritz: Ritz, movable: MovableMesh) -> "Functional":
        """Look up the constants of every region and how values are given on every chain.

        Raises
        ------
        ValueError
            If `ritz` is of another mesh, or its constants change inside a region.
        """
        triangulation, outline = movable.triangulation, movable.outline
        check_fits(ritz, triangulation.nnodes, len(triangulation.elements.node))
        values, fixed = np.asarray(ritz.values), np.asarray(ritz.fixed)
        kind, count = outline.constraints.kind, len(outline.constraints.chains.length)
        chain, node = nodes_of_chains(triangulation)
        whole = np.bincount(chain, weights=~fixed[node], minlength=count) == 0
        partly = np.bincount(chain, weights=fixed[node] & (kind[node] == SLIDING), minlength=count) > 0
        bare = np.bincount(chain, weights=kind[node] == SLIDING, minlength=count) == 0
        on_chain, off = line_of_chains(triangulation, outline, chain, node, values)
        straight = outline.constraints.chains.shape == STRAIGHT
        linear = whole & ~bare & straight & (off <= LINEAR * np.ptp(values))
        given = (whole & ~bare) | partly
        comparable = bool(np.all(straight)) and not np.any(given & ~linear) and not np.any(fixed & (kind == FREE))
        held = ~straight | (given & ~linear) | (whole & bare)
        constants = constants_of_regions(ritz, triangulation)
        law, tables = laws_of_regions(ritz, triangulation)
        return cls(values, fixed, constants, given, linear, held, on_chain, comparable, law, tables)

    def trial(self, triangulation: Triangulation, values: Floats, fixed: Mask) -> Trial:
        """A function, what of it is given and the functional, for the kernels: sweeps change `values`, (n,)."""
        law, bent = self.law[triangulation.elements.region], np.zeros(len(values), dtype=np.bool_)
        bent[triangulation.elements.node[law >= 0]] = True
        laws = Laws(law, self.tables.first, self.tables.energy)
        return Trial(values, fixed, self.on_chain, self.of_elements(triangulation), bent, laws)

    def of_elements(self, triangulation: Triangulation) -> Floats:
        """A half of the coefficient, a sixth of the source and a half of the flux of every element, (m, 4)."""
        return (self.constants / np.array([2.0, 6.0, 2.0, 2.0]))[triangulation.elements.region]

    def kinds(self, outline: Outline, fixed: Mask) -> NDArray[np.int8]:
        """What each node may do, (n,), when those are held whose given values no formula would carry along."""
        kind, chain = outline.constraints.kind, outline.constraints.own_chain
        sliding = kind == SLIDING
        held = ((kind == FREE) & fixed) | (outline.constraints.twins.partner >= 0)
        held[sliding] |= self.held[chain[sliding]]
        return np.where(held, HELD, kind).astype(kind.dtype)


def constants_of_regions(ritz: Ritz, triangulation: Triangulation) -> Floats:
    """Coefficient, source and flux of every region of the triangulation, (nregions, 4)."""
    region, number = triangulation.elements.region, numbers(ritz, triangulation)
    first = first_of_regions(triangulation)
    stray = np.flatnonzero(number != number[first][region])
    if len(stray):
        e = int(stray[0])
        raise VariesInside(
            f"region of Ritz must be one number on each region of the mesh; elements {first[region[e]]} and {e} are of "
            f"the same region but have {number[first[region[e]]]} and {number[e]}. Divide it by subdomains of the mesh."
        )
    tables = (ritz.coefficient, ritz.source, *np.asarray(ritz.flux))
    rows = [np.broadcast_to(table, max(1, np.size(table)))[number[first] * (np.ndim(table) > 0)] for table in tables]
    return np.stack(rows, axis=1)


def numbers(ritz: Ritz, triangulation: Triangulation) -> NDArray[np.int64]:
    """The region number of every element in the tables of the functional."""
    count = len(triangulation.elements.region)
    return np.zeros(count, dtype=np.int64) if ritz.region is None else np.asarray(ritz.region)


def first_of_regions(triangulation: Triangulation) -> NDArray[np.intp]:
    """The first element of every region."""
    return np.unique(triangulation.elements.region, return_index=True)[1]


def laws_of_regions(ritz: Ritz, triangulation: Triangulation) -> tuple[NDArray[np.int32], Tables]:
    """The law of every region as a place among tables, -1 for none, and the tables."""
    used = numbers(ritz, triangulation)[first_of_regions(triangulation)]
    distinct: list[EnergyLaw] = []
    law = np.full(len(used), -1, dtype=np.int32)
    for place, number in enumerate(used if ritz.laws else ()):
        found = ritz.laws[number]
        if found is not None:
            same = [k for k, other in enumerate(distinct) if other is found]
            law[place] = same[0] if same else len(distinct)
            distinct += [] if same else [found]
    return law, tabulated(distinct, steepest(ritz, triangulation) if distinct else 0.0)


def steepest(ritz: Ritz, triangulation: Triangulation) -> float:
    """The largest gradient of the solution."""
    node = triangulation.elements.node
    _, along_x, along_y = gradients(triangulation.position.T[:, node.T], np.asarray(ritz.values)[node.T])
    return float(np.hypot(along_x, along_y).max(initial=0.0))


def nodes_of_chains(triangulation: Triangulation) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The chain and the end nodes of every facet on one, a row for each end."""
    elements = triangulation.elements
    e, k = np.nonzero(elements.chain >= 0)
    node = np.concatenate([elements.node[e, (k + 1) % 3], elements.node[e, (k + 2) % 3]])
    return np.tile(elements.chain[e, k], 2), node


def line_of_chains(
    triangulation: Triangulation, outline: Outline, chain: NDArray[np.int32], node: NDArray[np.int32], values: Floats
) -> tuple[Floats, Floats]:
    """The straight line between the values at the ends of every chain, (c, 2), and how far values lie off it, (c,).

    Both mean nothing on curves.
    """
    chains = outline.constraints.chains
    way = triangulation.position[node] - chains.origin[chain]
    parameter = np.sum(way * chains.direction[chain], axis=1)
    order = np.lexsort((parameter, chain))
    last = np.cumsum(np.bincount(chain, minlength=len(chains.length))) - 1
    end, start = values[node[order[last]]], values[node[order[np.append(0, last[:-1] + 1)]]]
    rate = (end - start) / chains.length
    off = np.zeros(len(start))
    np.maximum.at(off, chain, np.abs(values[node] - start[chain] - rate[chain] * parameter))
    return np.stack([start, rate], axis=1), off
