"""Express a Ritz functional in terms of a movable solid: constants by region, given values by patch and ridge."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.kernels.arrays import Laws
from kohonen_adapt.kernels.tetrahedron.arrays import (
    HELD,
    INSIDE,
    LINE,
    ON_PATCH,
    ON_RIDGE,
    PLANE,
    Freedom,
    Tetrahedra,
    Trial,
)
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.polynomials import TrialFunction
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.outline.movable_solid import MovableSolid
from kohonen_adapt.polishing.curved_faces import CurvedFaces
from kohonen_adapt.polishing.energy_tables import Tables
from kohonen_adapt.polishing.regions import constants_of, laws_of_regions, numbers_of_regions
from kohonen_adapt.polishing.stationarity import check_in_space
from kohonen_adapt.polishing.surface_values import given_on
from kohonen_adapt.problem.functional_value import loads_in_space, value_in_space
from kohonen_adapt.problem.protocol import NotOffered
from kohonen_adapt.problem.ritz import Ritz, check_fits, unknown_in_space

__all__ = ["SolidFunctional"]

# Of a region what `Trial.data` has of its coefficient, source and flux.
PARTS = np.array([12.0, 24.0, 6.0, 6.0, 6.0])


@dataclass(frozen=True)
class SolidFunctional:
    """What the polish lowers on tetrahedra: it holds for the mesh as it is now, wherever its nodes and elements go.

    Rows of places are those of patches (p) and then of ridges (r).

    Attributes
    ----------
    solution
        What minimises it on the mesh that it was stated on.
    ritz
        As its user states it.
    number
        Region number, in its tables, of every region of the tetrahedralization, (nregions,).
    data
        What `Trial` calls so, (nregions, 5).
    patches
        How many there are.
    given
        Patches and ridges on which values are given, (p + r,) bool.
    held
        Those whose nodes are not to slide, and that are not to be given other nodes: curved ones of which is not known
        what their faces, which are chords, cut off; given values that are not linear there, or that only some of the
        nodes have; or no node within a patch whose values all are given, so that nobody can tell whether they are on
        it. So are ridges of such patches.
    rate
        Gradient of the given values along them, (p + r, 3); true where `given` and not `held`.
    comparable
        Whether values of the functional on moved meshes may be compared: the admissible functions are the same, for of
        all curved surfaces is known what faces cut off, and values are given on whole patches and ridges only, and
        linearly there.
    law
        Place of the law of every region in the tables, (nregions,) of int32; -1 where the region is linear.
    tables
        The energies of the laws.
    faces
        What lies between faces and curved surfaces.
    share
        None, for there is no dual.
    """

    solution: TrialFunction
    ritz: Ritz
    number: NDArray[np.int64]
    data: Floats
    patches: int
    given: Mask
    held: Mask
    rate: Floats
    comparable: bool
    law: NDArray[np.int32]
    tables: Tables
    faces: CurvedFaces
    share: None = None

    varies = False

    @classmethod
    def of(cls, ritz: Ritz, movable: MovableSolid, mesh: MeshTet | None = None) -> "SolidFunctional":
        """Look up the constants of every region, and how values are given on every patch and ridge.

        The mesh is that of the movable one as it is now, where that is at hand.

        Raises
        ------
        NotOffered
            If it has what is for the plane only.
        ValueError
            If it is of another mesh, or its constants change inside a region.
        """
        if unknown_in_space(ritz):
            raise NotOffered(unknown_in_space(ritz))
        check_fits(ritz, movable.mesh() if mesh is None else mesh)
        tet, surfaces = movable.tetrahedralization, movable.surfaces
        values, fixed = np.asarray(ritz.values), np.asarray(ritz.fixed)
        number = numbers_of_regions(ritz, tet.elements.region[tet.used])
        law, tables = laws_of_regions(ritz, number, steepest(tet, values) if any(ritz.laws) else 0.0)
        on = given_on(tet, surfaces, movable.freedom, values, fixed)
        patches, curved = len(surfaces.shape), surfaces.shape != PLANE
        linear = (~on.unknown & (~on.given | on.linear))[:patches]
        faces = CurvedFaces.of(tet, movable.patches, ritz, number, linear, on.given[:patches], on.rate[:patches])
        rims = (surfaces.ridge_shape != LINE) & ~np.append(curved, False)[surfaces.meets].any(axis=1)
        bent = np.append(curved & ~faces.counted, rims)
        held = bent | (on.given & ~on.linear) | on.unknown
        held[patches:] |= np.append(held[:patches], False)[surfaces.meets].any(axis=1)
        alike = not (bent.any() or np.any(on.given & ~on.linear) or np.any(fixed & (movable.freedom.number == INSIDE)))
        solution = TrialFunction(values.copy(), fixed.copy(), None)
        data = constants_of(ritz, number, TETRAHEDRON.dim) / PARTS
        places = on.given, held, on.rate
        return cls(solution, ritz, number, data, patches, *places, ritz.comparable and alike, law, tables, faces)

    @classmethod
    def of_solution(cls, ritz: Ritz, movable: MovableSolid, mesh: MeshTet) -> "SolidFunctional":
        """Look up the same for the solution of a problem, which is refused unless the functional is stationary there.

        Raises
        ------
        NotOffered, ValueError
            As `of` does, and a ValueError if the functional is not stationary.
        """
        functional = cls.of(ritz, movable, mesh)
        check_in_space(ritz, mesh, np.asarray(ritz.values), np.asarray(ritz.fixed))
        return functional

    @property
    def nearly(self) -> bool:
        """True if loops know nearly all of it only: not a source that varies, or what is beyond faces of a curve."""
        return self.has_varying_source or bool(self.faces.counted.any())

    @property
    def has_varying_source(self) -> bool:
        """True if the source is a function."""
        return callable(self.ritz.source)

    def trial(self, values: Floats, fixed: Mask) -> Trial:
        """A function, what of it is given and the functional, for the kernels: loops change `values`, (n,).

        A source that varies is zero until `sample_source`.
        """
        laws = Laws(self.law, self.tables.first, self.tables.energy)
        source = np.zeros((len(values) if self.has_varying_source else 0, len(self.number)))
        return Trial(values, fixed, self.data, laws, self.rate, self.faces.counted, self.faces.follows, source)

    def sample_source(self, position: Floats, elements: Tetrahedra, trial: Trial) -> None:
        """Work out a source that varies around every node and in every region, weighted by the node's function.

        Loads of nodes are those of the functional then.
        """
        if not callable(self.ritz.source):
            return
        used = elements.node[:, 0] >= 0
        node, region, shape = elements.node[used].T, elements.region[used], trial.source.shape
        corners, row = position.T[:, node], (node * np.int64(shape[1]) + region).ravel()
        loads = loads_in_space(corners, self.number[region], self.ritz.source)
        six = np.broadcast_to(np.abs(TETRAHEDRON.determinant(corners)), node.shape)
        load, total = (np.bincount(row, part.ravel(), trial.source.size).reshape(shape) for part in (loads, six))
        trial.source[:] = np.divide(load, total, out=np.zeros(shape), where=total > 0.0)

    def freedom(self, freedom: Freedom, fixed: Mask) -> Freedom:
        """What nodes may do when those are held whose given values no formula would carry along."""
        number = freedom.number
        held = freedom.pinned | ((number == INSIDE) & fixed)
        for kind, first in ((ON_PATCH, 0), (ON_RIDGE, self.patches)):
            rows = number == kind
            place = freedom.place[rows] + first
            held[rows] |= self.held[place] | (fixed[rows] & ~self.given[place])
        return freedom._replace(number=np.where(held, HELD, number).astype(number.dtype))

    def value(self, tetrahedralization: Tetrahedralization, trial: TrialFunction) -> float:
        """The functional of a function, with what is counted between faces and curved surfaces."""
        return self.value_on(tetrahedralization.position, tetrahedralization.elements, trial.values)

    def value_on(self, position: Floats, elements: Tetrahedra, values: Floats) -> float:
        """The same of values at nodes, (n,), of elements some rows of which may be in no use."""
        used = elements.node[:, 0] >= 0
        node, number = elements.node[used].T, self.number[elements.region[used]]
        own = value_in_space(position.T[:, node], values[node], number, self.ritz)
        return own + self.faces.value(position, elements, values)


def steepest(tet: Tetrahedralization, values: Floats) -> float:
    """The largest gradient of a function."""
    node = tet.elements.node[tet.used].T
    slope = np.einsum("dkm,km->dm", TETRAHEDRON.hat_gradients(tet.position.T[:, node]), values[node])
    return float(np.sqrt(np.sum(slope**2, axis=0).max(initial=0.0)))
