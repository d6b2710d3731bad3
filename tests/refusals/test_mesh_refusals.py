"""Meshes that are refused: each fault by one call, and each call with one fault."""

from types import SimpleNamespace

import numpy as np
import pytest
from helpers.meshes import square
from helpers.solids import box
from helpers.tetrahedra import REGULAR
from skfem import MeshHex, MeshLine, MeshQuad, MeshTet, MeshTet2, MeshTri, MeshTri1DG, MeshTri2
from skfem.mesh import MeshWedge1

import kohonen_adapt as ka
from kohonen_adapt import plotting
from kohonen_adapt.magnetostatics import Magnetostatics, Material

PLANE, SPACE = square(4), box(3)
INNER = SPACE.interior_nodes()[0]
IN_FACE = SPACE.p[:, SPACE.t[1:, 0]].mean(axis=1)  # opposite to the first node of element 0


def moved(mesh, node, place):
    p = mesh.p.copy()
    p[:, node] = place
    return type(mesh)(p, mesh.t)


def named(mesh, boundaries=None, subdomains=None):
    return type(mesh)(mesh.p, mesh.t, boundaries, subdomains)


def with_spare_node(mesh):
    return type(mesh)(np.hstack([mesh.p, np.full((len(mesh.p), 1), 2.0)]), mesh.t, validate=False)


def doubled(mesh):
    return type(mesh)(mesh.p, np.hstack([mesh.t, mesh.t[:, :1]]))


FOLDED = MeshTri(np.array([[0.0, 1, 0.2, 0.7], [0, 0, 1, 0.8]]), np.array([[0, 0], [1, 1], [2, 3]]))
THREE_AT_A_FACE = MeshTet(
    np.hstack([REGULAR, [[2, 2], [2, 3], [2, 4]]]), np.array([[0, 1, 2, 3], [1, 2, 3, 4], [1, 2, 3, 5]]).T
)
BROKEN = {  # what is said: the mesh
    r"the mesh is tangled: element \d+ shares an edge .* repair the mesh": moved(PLANE, 12, (0.9, 0.9)),
    r"the mesh is tangled: .*, of node \d+ at \([\d., ]+\) and node \d+ at \([\d., ]+\); repair": moved(
        PLANE, 0, (0.6, 0.6)
    ),
    r"the mesh is tangled: element 0 shares an edge with an element on the same side of it": FOLDED,
    r"the mesh is tangled: element 0 .*doubled": doubled(PLANE),
    r"every node must belong to an element; 1 do not, the first is node 25\. Drop them with mesh\.remove_unused": (
        with_spare_node(PLANE)
    ),
    r"every element must have an area above zero; 1 have none, the first is element 0\.": MeshTri(
        np.array([[0.0, 1, 2, 0], [0, 0, 0, 1]]), np.array([[0, 0], [1, 1], [2, 3]])
    ),
    r"mesh must have finite coordinates; node 7 is at \(nan, 0\.2\)\.": moved(PLANE, 7, (np.nan, 0.2)),
    r"mesh must have at least one element; got an empty mesh\.": MeshTri(
        np.zeros((2, 3)), np.zeros((3, 0), dtype=int), validate=False
    ),
    r"mesh\.t must hold node numbers from 0 to 24; got 1 to 25\.": MeshTri(PLANE.p, PLANE.t + 1, validate=False),
    r"the name of a boundary must be text; got 3\.": named(PLANE, {3: np.array([3])}),
    r"subdomain 'core' must have indices from 0 to 31; got 3 to 32\.": named(PLANE, None, {"core": np.array([3, 32])}),
    r"boundary 'rim' must have indices from 0 to 55; got -1 to 3\.": named(PLANE, {"rim": np.array([-1, 3])}),
    r"subdomain 'core' must be an array \(k,\) of integers; got bool of shape \(32,\)\. Masks: numpy\.flatnonzero": (
        named(PLANE, None, {"core": np.arange(32) < 5})
    ),
    r"boundary 'rim' must be an array \(k,\) of integers; got float64 of shape \(0,\)\.": named(PLANE, {"rim": []}),
    r"mesh must have coordinates .* in the xz-plane: rotate them with MeshTri\(mesh\.p\[\[0, 2\]\], mesh\.t\)\.": (
        MeshTri(np.array([PLANE.p[0], np.zeros(25), PLANE.p[1]]), PLANE.t)
    ),
    r"mesh must have coordinates of shape \(2, n\); got \(3, 25\)\.$": MeshTri(
        np.vstack([PLANE.p, np.zeros(25)]), PLANE.t, validate=False
    ),
    r"all nodes have the same y, so no element has an area\. If the drawing is in the xz-plane, rotate it to the": (
        MeshTri(np.array([PLANE.p[0], np.zeros(25)]), PLANE.t)
    ),
    r"the mesh is tangled: element \d+ shares a face with an element on the": moved(SPACE, INNER, (0.9, 0.9, 0.9)),
    r"the mesh is tangled: element [05] .*doubled": doubled(SPACE),
    r"the mesh is tangled: element \d shares a face with an element on the same side of it": THREE_AT_A_FACE,
    r"every element must have a volume above zero; [12] have none, the first is element 0\. Mesh again": moved(
        SPACE, SPACE.t[0, 0], IN_FACE
    ),
    r"mesh must have finite coordinates; node 7 is at \(nan, 0\.2, 0\.0\)": moved(SPACE, 7, (np.nan, 0.2, 0)),
    r"mesh must have coordinates of shape \(3, n\); got \(2, 64\)\.": MeshTet(SPACE.p[:2], SPACE.t),
    r"boundary 'rim' must have indices from 0 to 377; got 3 to 378\.": named(SPACE, {"rim": np.array([3, 378])}),
}


@pytest.mark.parametrize("said", BROKEN)
def test_every_fault_is_named(said):
    mesh = BROKEN[said]
    with pytest.raises(ValueError, match=f"^{said}"):
        ka.find_elements(mesh, np.zeros((len(mesh.p), 1)))


def ones(mesh, name="t"):
    return np.ones(getattr(mesh, name, np.ones((1, 1))).shape[1])


AREAS_ONLY = {  # these do not ask whether elements overlap
    "indicators": lambda mesh: ka.density_from_indicators(mesh, ones(mesh)),
    "sizes": lambda mesh: ka.density_from_sizes(mesh, ones(mesh)),
    "residual": lambda mesh: ka.estimators.residual(mesh, ones(mesh, "p"), ones(mesh)),
    "recovery": lambda mesh: ka.estimators.recovery(mesh, ones(mesh, "p"), ones(mesh)),
}
WHOLE = {
    "adapt": lambda mesh: ka.adapt(mesh, SimpleNamespace(solve=abs, indicators=abs)),
    "map": ka.KohonenMap,
    "relocate": lambda mesh: ka.relocate(mesh, ones(mesh)),
    "interpolate": lambda mesh: ka.interpolate(mesh, ones(mesh, "p"), np.zeros((2, 1))),
    "find": lambda mesh: ka.find_elements(mesh, np.zeros((2, 1))),
}
DOORS = AREAS_ONLY | WHOLE
FLAT, TANGLED = (next(each for each in BROKEN if each.startswith(said)) for said in ("every element", "the mesh is ta"))


@pytest.mark.parametrize("door", DOORS)
def test_every_call_checks_the_mesh(door):
    for said in [FLAT, TANGLED] if door in WHOLE else [FLAT]:
        with pytest.raises(ValueError, match=f"^{said}"):
            DOORS[door](BROKEN[said])


CLASSES = {
    r"MeshQuad1\. Split the quadrilaterals: mesh\.to_meshtri\(\)\.": MeshQuad().refined(1),
    r"MeshTri1DG\. Connect its elements: MeshTri\(mesh\.p, mesh\.dofs\.element_dofs\)\.remove_dup": (
        MeshTri1DG.from_mesh(PLANE)
    ),
    r"MeshHex1\. Split its elements into tetrahedra: mesh\.to_meshtet\(\)\.": MeshHex(),
    r"MeshWedge1\. Split its elements into tetrahedra: mesh\.to_meshtet\(\)\.": MeshWedge1(),
    r"MeshLine1\. This works in the plane and in space only\.": MeshLine(),
    r"str\. Build one with skfem\.MeshTri or MeshTet or kohonen_adapt\.read_mesh\.": "mesh.msh",
    r"NoneType\. Build one with skfem\.MeshTri or MeshTet or kohonen_adapt\.read_mesh\.": None,
}


@pytest.mark.parametrize("said", CLASSES)
def test_every_other_class_gets_its_remedy(said):
    with pytest.raises(ValueError, match=rf"^mesh must be a skfem\.MeshTri, MeshTri2, MeshTet or MeshTet2; got {said}"):
        ka.quality(CLASSES[said])


@pytest.mark.parametrize("door", DOORS)
def test_every_call_checks_the_class(door):
    kinds = r" or MeshTet" if door in ("residual", "recovery") else ", MeshTri2, MeshTet or MeshTet2"
    for mesh in (CLASSES[said] for said in CLASSES if said.startswith(("MeshQuad1", "NoneType"))):
        with pytest.raises(ValueError, match=rf"^mesh must be a skfem\.MeshTri{kinds}; got {type(mesh).__name__}"):
            DOORS[door](mesh)


FIELD = Magnetostatics({"air": Material()}, {"left": 0.0})
PLANE_ONLY = {
    "adapt, of a field": lambda mesh: ka.adapt(mesh, FIELD),
    "solve": FIELD.solve,
    "merge": lambda mesh: ka.merge(mesh, mesh),
    "turned": lambda mesh: ka.turned(mesh, "core", 1.0),
    "outlines": plotting.plot_outlines,
}


@pytest.mark.parametrize("door", PLANE_ONLY)
def test_what_works_in_the_plane_only_says_so(door):
    for mesh in [SPACE] if door == "adapt, of a field" else [SPACE, MeshTet2(), MeshHex(), MeshLine()]:
        said = (
            rf"^mesh must be a skfem\.MeshTri or MeshTri2; got {type(mesh).__name__}\. This works in the plane only\."
        )
        with pytest.raises(ValueError, match=said):
            PLANE_ONLY[door](mesh)


def test_the_remedies_work():
    discontinuous, second = MeshTri1DG.from_mesh(PLANE), MeshTri2.from_mesh(PLANE)
    for mesh in (
        MeshQuad().refined(2).to_meshtri(),
        MeshTri(second.p[:, : second.nvertices], second.t),
        MeshTri(discontinuous.p, discontinuous.dofs.element_dofs).remove_duplicate_nodes(),
        with_spare_node(PLANE).remove_unused_nodes(),
    ):
        assert mesh.p.shape == PLANE.p.shape
        assert ka.relocate(mesh, np.ones(32)).p.shape == mesh.p.shape
    for solid in (MeshHex(), MeshWedge1()):
        assert ka.quality(solid.to_meshtet()).min() > 0.5
    second = MeshTet2.from_mesh(SPACE)
    np.testing.assert_array_equal(ka.quality(MeshTet(second.p[:, : second.nvertices], second.t)), ka.quality(SPACE))
