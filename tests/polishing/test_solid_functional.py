"""The functional as stated on tetrahedra: its value, and what given values let nodes do."""

import numpy as np
import pytest
from helpers.meshes import square
from helpers.solids import box, two_regions
from skfem import MeshTri

from kohonen_adapt import NotOffered, Ritz, Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.polishing.energy_tables import VariesInside
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional
from kohonen_adapt.problem.boundary_terms import SurfaceTerms
from kohonen_adapt.problem.functional_value import functional_value


def functional_of(mesh, values, fixed, rules=None):
    kinds = (MovableMesh, Functional) if mesh.dim() == 2 else (MovableSolid, SolidFunctional)
    movable = kinds[0].of(mesh, Rules() if rules is None else rules)
    return movable, kinds[1].of(Ritz(values, fixed, 1.0), movable)


def halves(n=4):
    """A cube of two regions, and the number of each element's."""
    mesh = two_regions(n)
    number = np.zeros(mesh.nelements, dtype=int)
    number[mesh.subdomains["high"]] = 1
    return mesh, number


def test_a_flux_has_as_many_components_as_its_mesh():
    solid, plane = box(2), MeshTri().refined(1)
    for mesh, dim, other in ((solid, 3, 2), (plane, 2, 3)):
        values, fixed = mesh.p[0], np.zeros(mesh.nvertices, dtype=bool)
        assert functional_value(mesh, Ritz(values, fixed, 1.0)) == pytest.approx(0.5)
        assert functional_value(mesh, Ritz(values, fixed, 1.0, flux=(2.0, *[0.0] * (dim - 1)))) == pytest.approx(-1.5)
        with pytest.raises(ValueError, match=rf"must have {dim} components on a mesh of {dim} dim.* got {other}"):
            functional_value(mesh, Ritz(values, fixed, 1.0, flux=np.ones(other)))


def test_constants_must_not_change_inside_a_region():
    mesh, number = halves()
    fixed = np.zeros(mesh.nvertices, dtype=bool)
    number[mesh.subdomains["high"][3]] = 0
    with pytest.raises(VariesInside, match=r"constant on each region of the mesh; elements \d+ and \d+ are in"):
        SolidFunctional.of(Ritz(mesh.p[0], fixed, 1.0, region=number), MovableSolid.of(mesh, Rules()))
    with pytest.raises(ValueError, match=r"values of Ritz must have shape \(nnodes,\) = \(125,\); got \(8,\)"):
        SolidFunctional.of(Ritz(np.zeros(8), np.zeros(8, dtype=bool), 1.0), MovableSolid.of(mesh, Rules()))


MESH = box(2)
REST = {"values": MESH.p[0], "fixed": np.zeros(MESH.nvertices, dtype=bool), "coefficient": 1.0}
PLANE_ONLY = {
    "order 3 of Ritz": {"order": 3},
    "axisymmetric of Ritz": {"axisymmetric": True},
    "robin of Ritz": {"robin": {"left": (1.0, 0.0)}},
    "dual of Ritz": {"dual": Ritz(**REST)},
    "signs of Ritz": {"signs": {("left", "right"): 1}},
    "a function as flux of Ritz": {"flux": lambda x, number: x},
}


@pytest.mark.parametrize("reason", PLANE_ONLY)
def test_what_is_for_the_plane_only_is_said(reason):
    ritz = Ritz(**REST, **PLANE_ONLY[reason])
    with pytest.raises(NotOffered, match=f"{reason} is for triangles only"):
        SolidFunctional.of(ritz, MovableSolid.of(MESH, Rules()))
    with pytest.raises(ValueError, match=reason):
        functional_value(MESH, ritz)


def left(x):
    return x[0] == 0.0


def rim(x):
    return np.any((x == 0.0) | (x == 1.0), axis=0)


COMPARABLE = {  # values, and where they are given
    "nothing": (lambda x: x[0] * x[1], lambda x: x[0] < 0.0),
    "constant": (lambda x: 1.0 + 0 * x[0], left),
    "linear": (lambda x: 3 * x[1] - x[-1] / 3, left),
    "linear on every side": (lambda x: 2.0 * x[0] - x[1] + x[-1], rim),
    "other on other sides": (lambda x: np.where(left(x), 0.0, 2.0 * x[0]), lambda x: left(x) | (x[0] == 1.0)),
}
NOT_COMPARABLE = {
    "curved": (lambda x: x[1] * x[-1], left),
    "kinked": (lambda x: np.minimum(x[1], 0.5), left),
    "on a part of a side": (lambda x: 0 * x[1], lambda x: left(x) & (x[1] < 0.6)),
    "inside": (lambda x: 0 * x[1], lambda x: np.all(x == 0.5, axis=0)),
}


@pytest.mark.parametrize("mesh", [square(4), box(4)], ids=["plane", "space"])
def test_which_given_values_let_meshes_be_compared(mesh):
    for cases, comparable in ((COMPARABLE, True), (NOT_COMPARABLE, False)):
        for name, (values, fixed) in cases.items():
            assert functional_of(mesh, values(mesh.p), fixed(mesh.p))[1].comparable == comparable, name


def test_shifts_and_offsets_are_for_tetrahedra():
    plane = MeshTri().refined(1)
    rest = {"values": plane.p[0], "fixed": np.zeros(plane.nvertices, dtype=bool), "coefficient": 1.0}
    terms = SurfaceTerms(np.zeros((plane.nvertices, 2)), np.array([True]), lambda mesh: np.zeros((mesh.nvertices, 2)))
    for given in ({"shift": (1.0, 0.0, 0.0)}, {"surface": terms}):
        with pytest.raises(ValueError, match="shift and surface of Ritz are for tetrahedra only"):
            functional_value(plane, Ritz(**rest, **given))
    with pytest.raises(
        ValueError, match=r"surface of Ritz must be SurfaceTerms with nodal of shape \(27, 2\); got [^\n]+\.$"
    ):
        Ritz(**REST, surface=terms)
    with pytest.raises(ValueError, match=r"shift of Ritz must have shape"):
        Ritz(**REST, shift=np.ones(4))
