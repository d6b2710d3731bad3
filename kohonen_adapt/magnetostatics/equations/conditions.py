"""Constrain the unknowns on the boundaries: values given, nodes that are one; tell which unknowns are left."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array, csc_array
from scipy.sparse.csgraph import connected_components

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.elements import Elements
from kohonen_adapt.magnetostatics.equations.joints import Joints, Names, joints_of
from kohonen_adapt.magnetostatics.equations.open_boundary import robin_matrix
from kohonen_adapt.magnetostatics.equations.symmetry import Symmetry
from kohonen_adapt.mesh.names import named

__all__ = ["Boundaries", "Conditions", "Value", "conditions_of", "fixed_values"]

CONTRADICTION = 1e-9  # of the largest fixed value: values that joined nodes may differ by

Value = float | Callable[[Floats], ArrayLike]


@dataclass(frozen=True)
class Boundaries:
    """The boundary conditions of a problem, by name."""

    potential: Mapping[str, Value]
    open_boundary: str | None = None
    periodic: Names = ()
    antiperiodic: Names = ()


@dataclass(frozen=True)
class Conditions:
    """The boundary conditions on one mesh.

    Attributes
    ----------
    fixed
        (nunknowns,) bool: unknowns of given values.
    values
        (nunknowns,): these values, zero elsewhere.
    free
        The other unknowns.
    robin
        (nunknowns, nunknowns): what the open boundary adds to the matrix, or None.
    join
        (nfree, nclasses): the values of the free unknowns from one for each class of them, or None where each is its
        own.
    joints
        Unknowns that are one, or None.
    """

    fixed: Mask
    values: Floats
    free: Ints
    robin: csc_array | None = None
    join: csc_array | None = None
    joints: Joints | None = None

    @property
    def tied(self) -> Mask:
        """(nunknowns,) bool: unknowns of given values, and all that are one with others."""
        tied = self.fixed.copy()
        if self.joints is not None:
            tied[self.joints.one] = tied[self.joints.other] = True
        return tied

    def reduced(self, matrix: csc_array, right: Floats) -> tuple[csc_array, Floats]:
        """The equations of the free unknowns as those of their classes, the open boundary added to the matrix."""
        if self.robin is not None:
            matrix = (matrix + self.robin[self.free][:, self.free]).tocsc()
        if self.join is not None:
            matrix = (self.join.T @ matrix @ self.join).tocsc()
        return matrix, self.gathered(right)

    def gathered(self, pull: Floats) -> Floats:
        """The gradient by the classes, (nclasses,), of that by the free unknowns, (nfree,)."""
        return pull if self.join is None else self.join.T @ pull

    def expanded(self, values: Floats) -> Floats:
        """Values of the free unknowns, (nfree,), from those of their classes."""
        return values if self.join is None else self.join @ values

    def admitted(self, values: Floats) -> Floats:
        """The values nearest to these that keep the conditions, (nunknowns,)."""
        kept = np.where(self.fixed, self.values, values)
        if self.joints is not None:
            kept = np.where(self.fixed, self.values, self.joints.sign * kept[self.joints.master])
        return kept


def conditions_of(elements: Elements, given: Boundaries, symmetry: Symmetry) -> Conditions:
    """The conditions on the unknowns of the elements.

    Raises
    ------
    ValueError
        For names that the mesh lacks, values that contradict one another, pairs that do not match, an open boundary
        that is no circle, and connected parts of the mesh where nothing fixes the potential.
    """
    fixed, values = fixed_values(elements, given.potential)
    values, axis = symmetry.unknown(elements.places, values), symmetry.on_axis(elements.places)
    fixed, values = fixed | axis, np.where(axis, 0.0, values)
    robin = None if given.open_boundary is None else robin_matrix(elements, given.open_boundary, symmetry)
    joints = None
    if given.periodic or given.antiperiodic:
        joints = joints_of(elements, given.periodic, given.antiperiodic)
        fixed, values = _shared(elements.places, joints, fixed, values)
    _check_tied(elements.mesh.facets, elements.mesh.p.shape[1], fixed, robin, joints)
    free = np.flatnonzero(~fixed)
    return Conditions(fixed, values, free, robin, None if joints is None else _join(joints, free), joints)


def fixed_values(elements: Elements, potential: Mapping[str, Value]) -> tuple[Mask, Floats]:
    """Which unknowns have a given potential, (nunknowns,) bool, and the values there, (nunknowns,), zero elsewhere.

    A boundary hands its value to all unknowns of its facets; where several meet, the last in the mapping counts.
    """
    x = elements.places
    fixed, values = np.zeros(x.shape[1], dtype=bool), np.zeros(x.shape[1])
    for name, value in potential.items():
        rows = np.unique(elements.on_facets(named(elements.mesh.boundaries, name, "boundary")))
        fixed[rows] = True
        values[rows] = _evaluated(name, value, x[:, rows])
    return fixed, values


def _shared(x: Floats, joints: Joints, fixed: Mask, values: Floats) -> tuple[Mask, Floats]:
    """A value given at one node holds at all that are one with it, up to the sign."""
    share, given = np.zeros(len(values)), np.flatnonzero(fixed)
    share[joints.master[given]] = joints.sign[given] * values[given]
    fixed_class = joints.zero.copy()
    fixed_class[joints.master[given]] = True
    all_fixed = fixed_class[joints.master]
    shared = np.where(all_fixed & ~joints.zero, joints.sign * share[joints.master], 0.0)
    off = np.abs(shared - values)[given]
    if off.size and off.max() > CONTRADICTION * np.max(np.abs(values)):
        node = given[np.argmax(off)]
        raise ValueError(
            f"the potential {values[node]:g} fixed at node {node}, {tuple(x[:, node].tolist())}, contradicts its "
            f"periodic or antiperiodic partner, which makes it {shared[node]:g}. Fix the same value at both, with the "
            "other sign if antiperiodic."
        )
    return all_fixed, np.where(fixed, values, shared)


def _join(joints: Joints, free: Ints) -> csc_array:
    masters, column = np.unique(joints.master[free], return_inverse=True)
    return csc_array((joints.sign[free], (np.arange(free.size), column)), shape=(free.size, masters.size))


def _evaluated(name: str, value: Value, x: Floats) -> Floats:
    given = np.asarray(value(x) if callable(value) else value, dtype=float)
    if given.shape not in {(), x.shape[1:]}:
        raise ValueError(
            f"potential of {name!r} must be a float or have shape (n,) = {x.shape[1:]}; got {given.shape}."
        )
    everywhere = np.broadcast_to(given, x.shape[1:])
    bad = np.count_nonzero(~np.isfinite(everywhere))
    if bad:
        raise ValueError(f"potential of {name!r} must be finite; it is not at {bad} of its {everywhere.size} nodes.")
    return everywhere


def _check_tied(facets: Ints, nodes: int, fixed: Mask, robin: csc_array | None, joints: Joints | None) -> None:
    """Every connected part of the mesh needs a condition, or its potential is known up to a constant only."""
    pairs, tied = facets, fixed[:nodes]
    if robin is not None:
        tied = tied | (robin.diagonal()[:nodes] > 0.0)
    if joints is not None:
        joined = joints.one < nodes
        pairs, tied = np.hstack((pairs, np.stack((joints.one[joined], joints.other[joined])))), tied.copy()
        tied[joints.one[joined & (joints.between < 0.0)]] = True  # no constant is its own negative
    graph = coo_array((np.ones(pairs.shape[1], dtype=np.int8), tuple(pairs)), shape=(nodes,) * 2)
    parts, part = connected_components(graph, directed=False)
    loose = np.setdiff1d(np.arange(parts), part[tied])
    if loose.size:
        node = int(np.flatnonzero(part == loose[0])[0])
        raise ValueError(
            f"the potential is fixed nowhere on {loose.size} of the {parts} connected parts of the mesh, "
            f"first the one of node {node}. Fix it there by a boundary name."
        )
