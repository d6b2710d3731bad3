"""Held nodes have a reason in words, and nodes without a reason move."""

import numpy as np
import pytest
from helpers.meshes import centres
from numpy.testing import assert_array_equal
from skfem import MeshQuad, MeshTet, MeshTri

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import FluxLinkage, MagneticScalarPotential, Magnetostatics, Material

HALVES = {"left": lambda x: x[0] < 0.5, "right": lambda x: x[0] > 0.5}


def square(levels=3):
    return MeshTri().refined(levels).with_subdomains(HALVES).with_boundaries({"rim": lambda x: x[0] < 2.0})


def at(mesh, *x):
    return int(np.argmin(np.sum((mesh.p - np.array(x)[:, None]) ** 2, axis=0)))


def test_a_turn_without_a_curve_asks_for_one():
    angles = np.radians([0.0, 20.0, 40.0])
    rim = np.stack([np.cos(angles), np.sin(angles)])
    mesh = MeshTri(np.hstack([[[0.0], [0.0]], rim]), np.array([[0, 0], [1, 2], [2, 3]]))
    why = ka.why_held(mesh.with_boundaries({"rim": lambda x: x[0] ** 2 + x[1] ** 2 > 0.9}))
    assert why[2] == "no curve of boundary 'rim' is recognised at a turn of 20 degrees; use `curves`"


def test_a_line_meets_a_recognised_arc_at_the_end_of_a_curve():
    """A stadium, whose arcs turn as little at their ends as between their facets."""
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 17)
    right = np.stack([1.0 + np.cos(angles), np.sin(angles)])
    rim = np.hstack([right, [[0.5, 0.0, -0.5], [1.0] * 3], -right, [[-0.5, 0.0, 0.5], [-1.0] * 3]])
    rows = np.arange(rim.shape[1])
    mesh = MeshTri(np.hstack([rim, np.zeros((2, 1))]), np.stack([rows, (rows + 1) % len(rows), 0 * rows + len(rows)]))
    why = ka.why_held(mesh.with_boundaries({"rim": lambda x: np.abs(x).sum(axis=0) > 0.0}))
    assert set(np.flatnonzero(why)) == {at(mesh, x, y) for x in (-1.0, 1.0) for y in (-1.0, 1.0)}
    assert set(why) == {"", "end of a curve of boundary 'rim'"}


@pytest.mark.parametrize("mesh", [square(), MeshTet().refined(3)], ids=["triangles", "tetrahedra"])
def test_held_nodes_stay_and_most_others_move(mesh):
    """Corners may pass from node to node, hence positions are compared as sets."""
    why = ka.why_held(mesh)
    moved = ka.relocate(mesh, lambda x: 1.0 / (0.05 + x[0]) ** 2, topology="fixed")
    still = np.all(np.isclose(moved.p, mesh.p, rtol=0.0, atol=1e-14), axis=0)
    held = {tuple(x) for x in mesh.p[:, why != ""].T.round(12)}
    assert held <= {tuple(x) for x in moved.p.T.round(12)}
    assert np.mean(still[why == ""]) < 0.3


SIDES = {"left side": lambda x: x[0] == 0.0, "right side": lambda x: x[0] == 1.0, "floor": lambda x: x[1] == 0.0}
COIL = {"left": Material(current_density=1e6), "right": Material()}


def of_sides():
    return MeshTri().refined(3).with_subdomains(HALVES).with_boundaries(SIDES)


def field(order=1, **more):
    return Magnetostatics(COIL, order=order, **{"potential": {"floor": 0.0}, **more})


class Alone:
    def solve(self, mesh):
        return np.zeros(mesh.nvertices)

    def indicators(self, mesh, solution):
        x = centres(mesh)
        return 1.0 / (0.05 + np.hypot(x[0] - 1.0, x[1])) ** 2


def round_coil(levels):
    mesh = MeshTri.init_circle(levels).with_boundaries({"rim": lambda x: x[0] ** 2 + x[1] ** 2 > 0.5})
    return mesh.with_subdomains({"coil": np.arange(mesh.nelements)})


def current_in(order):
    return Magnetostatics({"coil": Material(current_density=1e6)}, {"rim": 0.0}, order=order, curved=False)


PAIRS = [("left side", "right side")]
PROBE = {"probe": np.array([[0.75], [0.75]])}
MIDDLE = 0.5, 0.5
PINNED = ka.Rules(pinned=["right side", at(of_sides(), *MIDDLE)])
REASONS = [  # mesh, problem and rules, and reasons by the places of nodes
    (square(), [ka.Rules(pinned=[at(square(), 0.25, 0.25)])], {
        (0.0, 0.0): "corner of boundary 'rim', 90 degrees",
        (0.5, 0.0): "junction of 3 boundaries and interfaces at boundary 'rim'",
        (0.25, 0.25): "pinned by number",
    }),
    (square(), [field(potential={"rim": 0.0})], {(0.25, 0.0): ""}),
    (square(), [field(potential={"rim": lambda x: x[0] ** 2})], {
        (0.25, 0.0): "polish: Dirichlet values that are not linear along boundary 'rim'",
    }),
    (square(), [Alone()], {(0.3, 0.3): "polish: Alone has no method ritz(mesh, solution)"}),
    (of_sides(), [ka.Rules(pinned=["floor", "left"])], {
        (1.0, 0.0): "pinned by boundary 'floor'", (0.25, 0.5): "pinned by subdomain 'left'",
    }),
    (of_sides(), [ka.Rules(periodic=PAIRS)], {(0.0, 0.5): ""}),
    (of_sides(), [ka.Rules(periodic=PAIRS, pinned=["right side"])], {
        (0.0, 0.0): "corner of boundaries 'floor', 'left side', 90 degrees",
        (0.0, 0.5): "periodic pair on boundary 'left side', whose other node cannot slide",
    }),
    *(
        (of_sides(), [field(order, periodic=PAIRS, points=PROBE), PINNED], {
            (0.75, 0.75): "point 'probe' of the problem",
            MIDDLE: "pinned by number",
            (1.0, 0.5): "pinned by boundary 'right side'",
            (0.0, 0.5): "periodic pair on boundary 'left side', whose other node cannot slide",
            (0.25, 0.0): "",
            (0.25, 0.25): "",
        })
        for order in (1, 2, 3)
    ),
    (round_coil(3), [current_in(1)], {(1.0, 0.0): "polish: source that ends at the curve of boundary 'rim'"}),
    (round_coil(3), [current_in(3)], {
        (1.0, 0.0): "polish: curve of boundary 'rim', where the polish moves no node at order 3", (0.0, 0.0): "",
    }),
]  # fmt: skip


@pytest.mark.parametrize(("mesh", "given", "reasons"), REASONS)
def test_held_nodes_say_why(mesh, given, reasons):
    why = ka.why_held(mesh, *given)
    assert {place: why[at(mesh, *place)] for place in reasons} == reasons


RIMS = {
    "given": ({"potential": {"rim": 0.0}}, {1: "", 2: "curve", 3: "curve"}),
    "open": ({"open_boundary": "rim"}, dict.fromkeys((1, 2, 3), "open boundary 'rim' (Robin condition)")),
}


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("condition", RIMS)
@pytest.mark.parametrize("goal", [None, FluxLinkage({"coil": 1.0})], ids=["energy", "goal"])
def test_the_polish_moves_no_node_of_a_rim_with_a_reason(condition, order, goal):
    mesh = MeshTri.init_circle(4).with_boundaries({"rim": lambda x: x[0] < 2.0})
    mesh = mesh.with_subdomains({"coil": lambda x: x[0] ** 2 + x[1] ** 2 < 0.1})
    mesh = mesh.with_subdomains({"air": np.setdiff1d(np.arange(mesh.nelements), mesh.subdomains["coil"])})
    keywords, reasons = RIMS[condition]
    problem = Magnetostatics(
        {"coil": Material(current_density=1e6), "air": Material()}, **keywords, order=order, goal=goal, curved=False
    )
    why, rim = ka.why_held(mesh, problem), mesh.boundary_nodes()
    assert all(reason.removeprefix("polish: ").startswith(reasons[order]) for reason in why[rim])
    assert np.all((why[rim] == "") == (reasons[order] == ""))
    still = np.all(ka.polish(mesh, problem).p == mesh.p, axis=0)
    assert np.all(still[why != ""]) and np.mean(still[why == ""]) < 0.01


def test_a_final_order_is_not_the_order_of_the_polish():
    mesh = square()
    low, high = (Magnetostatics(COIL, {"rim": 0.0}, order=order) for order in (2, 5))
    assert_array_equal(ka.why_held(mesh, high), ka.why_held(mesh, low))


def slab():
    halves = {"air": lambda x: x[0] < 0.5, "iron": lambda x: x[0] > 0.5}
    sides = {"bottom": lambda x: x[2] == 0.0, "top": lambda x: x[2] == 1.0}
    return MeshTet().refined(2).with_subdomains(halves).with_boundaries(sides)


def between_plates():
    """The problem of the slab, with values that are not linear on its top."""
    materials = {"air": Material(), "iron": Material(permeability=100.0)}
    return MagneticScalarPotential(materials, {"bottom": 0.0, "top": lambda x: x[0] ** 2})


def test_tetrahedra_say_what_holds_their_nodes():
    mesh, problem = slab(), between_plates()
    why = ka.why_held(mesh, problem, ka.Rules(pinned=["bottom", at(mesh, 0.25, 0.25, 0.25)]))
    assert why[at(mesh, 0.5, 0.5, 0.0)] == "pinned by boundary 'bottom'"
    assert why[at(mesh, 0.25, 0.25, 0.25)] == "pinned by number"
    assert why[at(mesh, 1.0, 1.0, 1.0)] == "corner of 3 faces of boundary 'top'"
    nonlinear = "polish: Dirichlet values that are not linear on the {} of boundary 'top'"
    assert why[at(mesh, 0.25, 0.5, 1.0)] == nonlinear.format("face")
    assert why[at(mesh, 0.25, 0.0, 1.0)] == nonlinear.format("edge")
    assert why[at(mesh, 0.75, 0.5, 0.5)] == ""
    still = np.all(ka.polish(mesh, problem, pinned=["bottom"]).p == mesh.p, axis=0)
    assert np.all(still[why != "pinned by number"] == (why[why != "pinned by number"] != ""))


def counts(result):
    return np.array([(p.refused_by_quality, p.refused_by_reach, p.held_in_polish, p.unmoved) for p in result.history])


LESSON = ka.Schedule((ka.Stage(1, 2, 0.3),), sweeps=1)
COUNTED = {  # mesh, problem, options, and how often a strict rule refuses more
    "flip": (round_coil(4), current_in(1), {"topology": "flip"}, 10),
    "recycle": (round_coil(4), current_in(1), {"topology": "recycle"}, 10),
    "sweeps": (slab(), between_plates(), {"topology": "fixed"}, 1),
    "map": (slab(), between_plates(), {"topology": "fixed", "schedule": LESSON}, 1),
}


@pytest.mark.parametrize("name", COUNTED)
def test_passes_count_what_they_refuse(name):
    mesh, problem, options, factor = COUNTED[name]
    lax, strict = (counts(ka.adapt(mesh, problem, passes=1, min_quality=q, **options))[:2] for q in (0.0, 0.8))
    assert not lax[0].any() and not strict[0].any()  # the input
    assert strict[1, 0] > factor * lax[1, 0] and (factor > 1 or strict[1, 3] > lax[1, 3])
    assert lax[1, 2] == strict[1, 2] == np.sum(np.char.startswith(ka.why_held(mesh, problem), "polish: "))


def test_passes_count_moves_beyond_reach():
    """Two nodes on a rim of eight facets may not leave a facet that turns by more."""
    rules = {"curves": {"rim": ka.Arc((0.0, 0.0), 1.0)}, "topology": "fixed", "polish": False}
    result = ka.adapt(round_coil(2), Alone(), passes=1, min_quality=0.0, **rules)
    assert result.history[1].refused_by_reach > 0


def test_what_is_neither_problem_nor_rules_is_refused():
    with pytest.raises(TypeError, match="requires Rules once"):
        ka.why_held(square(), ka.Rules(), ka.Rules())
    with pytest.raises(TypeError, match="rules of why_held must be"):
        ka.why_held(square(), rules=3)
    with pytest.raises(TypeError, match=r"requires a problem with the method solve\(mesh\), or Rules; got 3\."):
        ka.why_held(square(), 3)
    with pytest.raises(ValueError, match="MeshQuad"):
        ka.why_held(MeshQuad())
