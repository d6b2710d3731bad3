"""Ritz functional on movable tetrahedra."""

from dataclasses import dataclass

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Int32s, Int64s, Mask
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.arrays import Modes
from kohonen_adapt.kernels.functionals import Laws
from kohonen_adapt.kernels.numba.compilation import zeros
from kohonen_adapt.kernels.tetrahedron.arrays import (
    HELD,
    INSIDE,
    LINE,
    LOAD,
    NO_SURFACE,
    OFFSET,
    ON_PATCH,
    ON_RIDGE,
    PLANE,
    Freedom,
    Tetrahedra,
    Trial,
)
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.elements.element_functions import ElementFunctions
from kohonen_adapt.mesh.elements.polynomials import (
    TrialFunction,
    edge_coefficients,
    hierarchical_loads,
    unknowns_of_elements,
)
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.polishing.energy_tables import Tables, constants_of, laws_of_regions, numbers_of_regions
from kohonen_adapt.polishing.space.curved_sides import CurvedEdges, CurvedFaces
from kohonen_adapt.polishing.space.surface_values import dirichlet_on, ridges_at, sides_of, with_loads
from kohonen_adapt.polishing.stationarity import check_in_space
from kohonen_adapt.problem.boundary_terms import (
    corner_values,
    nodal_terms,
    reduced_regions,
    surface_work,
)
from kohonen_adapt.problem.functional_value import source_loads, steepest, value_on
from kohonen_adapt.problem.protocol import NotOffered
from kohonen_adapt.problem.ritz import Ritz, check_matches, plane_only_term
from kohonen_adapt.problem.tables import flux_table

__all__ = ["SolidFunctional", "terms_at_nodes"]


@dataclass(frozen=True)
class SolidFunctional:
    """Functional that the polish lowers on tetrahedra, valid while nodes move.

    Rows of Dirichlet data are faces of the body (patches, p), then edges of the body (ridges, r).

    Attributes
    ----------
    solution
        Minimiser of the functional on the input mesh.
    ritz
        User-defined functional.
    number
        Index of every region in the tables of the functional, (nregions,).
    data
        Constants of every region, as the fields of `Trial` from `twelfth` to `reduced`.
    patches
        Number of patches.
    dirichlet
        Patches and ridges with Dirichlet values, (p + r,) bool.
    held
        Patches and ridges whose nodes do not slide and are not recycled, (p + r,) bool: patches with offsets or loads,
        curved patches whose slivers are not counted, as all at order 2, Dirichlet values that are not linear or not on
        all nodes, and patches without an inner node whose nodes all have Dirichlet values, which may or may not be
        Dirichlet patches. Ridges of held patches are held.
    driven
        Patches with offsets or loads, (p,) bool.
    unknown
        Patches and ridges without a sliding node that may have Dirichlet values, (p + r,) bool.
    rate
        Gradient of the Dirichlet values along patches and ridges, (p + r, 3), valid where `dirichlet` and not `held`.
    comparable
        True if values of the functional on different meshes are comparable, because the set of admissible
        functions does not depend on the mesh.
    law
        Index of the law of every region in the tables, (nregions,), -1 if linear.
    tables
        Energies of the laws.
    faces
        Slivers between faces and curved surfaces.
    share
        None, because there is no dual.
    """

    solution: TrialFunction
    ritz: Ritz
    number: Int64s
    data: tuple[Floats, Floats, Floats, Floats, Floats]
    patches: int
    dirichlet: Mask
    held: Mask
    driven: Mask
    unknown: Mask
    rate: Floats
    comparable: bool
    law: Int32s
    tables: Tables
    faces: CurvedFaces
    share: None = None

    varies = False

    @classmethod
    def of(cls, ritz: Ritz, movable: MovableSolid, mesh: MeshTet | None = None) -> "SolidFunctional":
        """Return the functional of `ritz` on `movable`.

        `mesh` is the current mesh of `movable`, built if None.

        Raises
        ------
        NotOffered
            If `ritz` has terms for the plane only.
        ValueError
            If `ritz` is of a different mesh, or its constants change inside a region.
        """
        if plane_only_term(ritz):
            raise NotOffered(plane_only_term(ritz))
        mesh = movable.mesh() if mesh is None else mesh
        check_matches(ritz, mesh)
        tet, surfaces = movable.tetrahedralization, movable.surfaces
        number = numbers_of_regions(ritz, tet.elements.region[tet.used])
        nodal, reduced = nodal_terms(ritz.surface), reduced_regions(ritz.surface, number)
        solution = solution_on(ritz, tet, mesh, reduced)
        law, tables = laws_of_regions(ritz, number, steepest(mesh, ritz) if any(ritz.laws) else 0.0)
        driven, of_reduced = sides_of(tet, surfaces, reduced)
        on = dirichlet_on(tet, surfaces, movable.freedom, solution, of_reduced)
        patches = len(surfaces.shape)
        curved = surfaces.shape != PLANE
        if len(nodal):
            driven |= with_loads(tet, movable.freedom, solution.surface, patches)
        free = (~on.unknown & (~on.dirichlet | on.linear))[:patches] & ~driven & (ritz.order == 1)
        faces = CurvedFaces.of(tet, movable.patches, ritz, number, free, on.dirichlet[:patches], on.rate[:patches])
        at_curved = ridges_at(surfaces, curved)
        rims = (surfaces.ridge_shape != LINE) & ~at_curved
        uncounted = np.append(curved & ~faces.counted, rims)
        held = uncounted | (on.dirichlet & ~on.linear) | on.unknown
        held[:patches] |= driven
        held[patches:] |= ridges_at(surfaces, held[:patches])
        held[patches:] |= at_curved & (on.dirichlet & ~on.linear)[patches:]
        same_space = not (
            uncounted.any()
            or np.any(on.dirichlet & ~on.linear)
            or np.any(solution.fixed & (movable.freedom.number == INSIDE))
            or np.any(nodal[:, OFFSET])
        )
        shift = np.atleast_2d(flux_table(np.asarray(ritz.shift), TETRAHEDRON.dim).T)
        shift = shift[number if len(shift) > 1 else np.zeros_like(number)]
        constants = constants_of(ritz, number, TETRAHEDRON.dim)
        parts = constants[:, 0] / 12.0, constants[:, 1] / 24.0, constants[:, 2:] / 6.0
        data = *parts, np.ascontiguousarray(shift), reduced.astype(np.float64)
        places = (on.dirichlet, held, driven, on.unknown, on.rate)
        comparable = ritz.comparable and same_space
        return cls(solution, ritz, number, data, patches, *places, comparable, law, tables, faces)

    @classmethod
    def of_solution(cls, ritz: Ritz, movable: MovableSolid, mesh: MeshTet) -> "SolidFunctional":
        """Return the functional of a solution, which must be stationary.

        Raises
        ------
        NotOffered
            If `of` raises.
        ValueError
            If `of` raises, or if the functional is not stationary at the solution.
        """
        functional = cls.of(ritz, movable, mesh)
        check_in_space(ritz, mesh)
        return functional

    @property
    def is_approximate(self) -> bool:
        return self.has_varying_source or bool(self.faces.counted.any())

    @property
    def has_varying_source(self) -> bool:
        return callable(self.ritz.source)

    def trial(self, values: Floats, fixed: Mask, surface: Floats = NO_SURFACE) -> Trial:
        """Return the function for the kernels, which change `values` (n,) in place.

        A varying source is 0 until `sample_source`. `surface` has offsets and loads, (n, 2), or no rows.
        """
        laws = Laws(self.law, self.tables.first, self.tables.energy)
        source = np.zeros((len(values) if self.has_varying_source else 0, len(self.number)))
        patches = self.faces.counted, self.faces.follows
        return Trial(values, fixed, *self.data, laws, self.rate, *patches, source, surface)

    def sample_source(self, position: Floats, elements: Tetrahedra, trial: Trial) -> None:
        # A varying source per node and region is weighted by the shape function, so that nodal loads are exact.
        if not callable(self.ritz.source):
            return
        used = elements.node[:, 0] >= 0
        node = elements.node[used].T
        region = elements.region[used]
        shape = trial.source.shape
        corners = position.T[:, node]
        row = (node * np.int64(shape[1]) + region).ravel()
        functions = ElementFunctions(corners, 1, np.zeros(region.shape, bool))
        loads = source_loads(functions, self.number[region], self.ritz.source)
        six = np.broadcast_to(np.abs(TETRAHEDRON.determinant(corners)), node.shape)
        load, total = (np.bincount(row, part.ravel(), trial.source.size).reshape(shape) for part in (loads, six))
        trial.source[:] = np.divide(load, total, out=np.zeros(shape), where=total > 0.0)

    def freedom(self, freedom: Freedom, fixed: Mask, surface: Floats = NO_SURFACE) -> Freedom:
        number = freedom.number
        held = freedom.pinned | ((number == INSIDE) & fixed)
        for kind, first in ((ON_PATCH, 0), (ON_RIDGE, self.patches)):
            rows = number == kind
            place = freedom.place[rows] + first
            held[rows] |= self.held[place] | (fixed[rows] & ~self.dirichlet[place])
        if len(surface):
            held |= surface[:, LOAD] != 0.0
        return freedom._replace(number=np.where(held, HELD, number).astype(number.dtype))

    def value(self, tetrahedralization: Tetrahedralization, trial: TrialFunction) -> float:
        return self.value_on(tetrahedralization.position, tetrahedralization.elements, trial)

    def value_on(
        self, position: Floats, elements: Tetrahedra, trial: TrialFunction, curves: CurvedEdges | None = None
    ) -> float:
        used = elements.node[:, 0] >= 0
        values = trial.values
        node = elements.node[used].T
        number = self.number[elements.region[used]]
        on_corners = corner_values(values, trial.surface, node, reduced_regions(self.ritz.surface, number))
        if trial.modes is not None:  # without the work of loads, whose values do not change
            coefficients = np.vstack([on_corners, trial.modes.side[used, :, 0].T])
            offset = np.zeros((3, 6, node.shape[1])) if curves is None else curves.on(node)
            return value_on(position.T[:, node], coefficients, number, self.ritz, offset)
        own = value_on(position.T[:, node], on_corners, number, self.ritz) - surface_work(values, trial.surface)
        return own + self.faces.value(position, elements, values, trial.surface)


def solution_on(ritz: Ritz, tet: Tetrahedralization, mesh: MeshTet, reduced: Mask) -> TrialFunction:
    values, fixed = np.asarray(ritz.values), np.asarray(ritz.fixed)
    n = tet.nnodes
    m = len(tet.elements.node)
    surface, own = nodal_terms(ritz.surface), terms_at_nodes(nodal_terms(ritz.surface), mesh)
    if ritz.order == 1:
        return TrialFunction(values.copy(), fixed.copy(), None, surface=own)
    modes = zero_modes(m)
    unknowns = unknowns_of_elements(mesh, tet.elements.node[tet.used].T)
    local = corner_values(values, surface, unknowns, reduced[tet.elements.region[tet.used]])
    modes.side[tet.used, :, 0], modes.dirichlet[tet.used] = edge_coefficients(local)[4:].T, fixed[unknowns[4:]].T
    return TrialFunction(values[:n].copy(), fixed[:n].copy(), modes, surface=own)


def zero_modes(elements: int) -> Modes:
    return zeros(Modes, (elements, 6, 1), elements, (elements, 6))


def terms_at_nodes(nodal: Floats, mesh: MeshTet) -> Floats:
    # offsets and loads of the hierarchical functions, (nnodes, 2)
    count = int(mesh.nvertices)
    if len(nodal) <= count:
        return nodal
    return np.column_stack([nodal[:, OFFSET], hierarchical_loads(mesh, nodal[:, LOAD])])[:count]
