"""Held nodes have a reason in words, and nodes without a reason move."""

import numpy as np
import pytest
from skfem import MeshQuad, MeshTet, MeshTri

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material

HALVES = {"left": lambda x: x[0] < 0.5, "right": lambda x: x[0] > 0.5}


def square(levels=3):
    return MeshTri().refined(levels).with_subdomains(HALVES).with_boundaries({"rim": lambda x: x[0] < 2.0})


def at(mesh, *x):
    return int(np.argmin(np.sum((mesh.p - np.array(x)[:, None]) ** 2, axis=0)))


def test_corners_junctions_and_pinned_nodes_say_so():
    mesh = square()
    why = ka.why_held(mesh, ka.Rules(pinned=[at(mesh, 0.25, 0.25)]))
    assert why[at(mesh, 0.0, 0.0)] == "corner of boundary 'rim', 90 degrees"
    assert why[at(mesh, 0.5, 0.0)] == "junction of 3 boundaries and interfaces at boundary 'rim'"
    assert why[at(mesh, 0.25, 0.25)] == "pinned"
    assert (why != "").sum() == 4 + 2 + 1


def test_a_turn_without_a_curve_asks_for_one():
    angles = np.radians([0.0, 20.0, 40.0])
    rim = np.stack([np.cos(angles), np.sin(angles)])
    mesh = MeshTri(np.hstack([[[0.0], [0.0]], rim]), np.array([[0, 0], [1, 2], [2, 3]]))
    why = ka.why_held(mesh.with_boundaries({"rim": lambda x: x[0] ** 2 + x[1] ** 2 > 0.9}))
    assert why[2] == "no curve of boundary 'rim' is recognised at a turn of 20 degrees; use `curves`"


@pytest.mark.parametrize("mesh", [square(), MeshTet().refined(3)], ids=["triangles", "tetrahedra"])
def test_held_nodes_stay_and_most_others_move(mesh):
    """Corners may pass from node to node, hence positions are compared as sets."""
    why = ka.why_held(mesh)
    moved = ka.relocate(mesh, lambda x: 1.0 / (0.05 + x[0]) ** 2, topology="fixed")
    still = np.all(np.isclose(moved.p, mesh.p, rtol=0.0, atol=1e-14), axis=0)
    held = {tuple(x) for x in mesh.p[:, why != ""].T.round(12)}
    assert held <= {tuple(x) for x in moved.p.T.round(12)}
    assert np.mean(still[why == ""]) < 0.3


def test_the_polish_has_reasons_of_its_own():
    mesh = square()
    materials = {"left": Material(current_density=1e6), "right": Material()}
    linear, bent = (Magnetostatics(materials, {"rim": f}, order=1) for f in (0.0, lambda x: x[0] ** 2))
    v = at(mesh, 0.25, 0.0)
    assert ka.why_held(mesh, linear)[v] == ""
    assert ka.why_held(mesh, bent)[v] == "polish: Dirichlet values that are not linear along the boundary"


def test_a_corner_of_a_periodic_side_is_a_corner():
    sides = {"left": lambda x: x[0] == 0.0, "right": lambda x: x[0] == 1.0}
    mesh = MeshTri().refined(3).with_boundaries(sides)
    why = ka.why_held(mesh, ka.Rules(periodic=[("left", "right")]))
    assert why[at(mesh, 0.0, 0.0)] == "corner of boundary 'left', 90 degrees"


@pytest.mark.parametrize(
    ("order", "reason"),
    [(1, "polish: source that ends at a curve"), (3, "polish: curve on which the polish moves no node")],
)
def test_nodes_on_a_curve_stay_in_the_polish_where_it_says_so(order, reason):
    mesh = MeshTri.init_circle(3)
    mesh = mesh.with_subdomains({"coil": np.arange(mesh.nelements)}).with_boundaries({"rim": lambda x: x[0] < 2.0})
    problem = Magnetostatics({"coil": Material(current_density=1e6)}, {"rim": 0.0}, order=order, curved=False)
    why, polished = ka.why_held(mesh, problem), ka.polish(mesh, problem)
    rim = mesh.boundary_nodes()
    assert set(why[rim]) == {reason} and set(np.delete(why, rim)) == {""}
    np.testing.assert_array_equal(polished.p[:, rim], mesh.p[:, rim])


class Alone:
    def solve(self, mesh):
        return np.zeros(mesh.nvertices)


def test_a_problem_without_energy_says_what_it_lacks():
    why = ka.why_held(square(), Alone())
    assert why[at(square(), 0.3, 0.3)] == "polish: Alone has no method ritz(mesh, solution)"


def test_what_is_neither_problem_nor_rules_is_refused():
    with pytest.raises(TypeError, match=r"requires a problem with the method solve\(mesh\), or Rules; got 3\."):
        ka.why_held(square(), 3)
    with pytest.raises(ValueError, match="MeshQuad"):
        ka.why_held(MeshQuad())
