"""Names that a user gets wrong: keywords of the front doors, and those of the protocol of a problem."""

import re

import numpy as np
import pytest
from helpers.stand_ins import MESH
from skfem import MeshTri

import kohonen_adapt as ka


class Even:
    """A problem whose error is everywhere the same."""

    def solve(self, mesh):
        return mesh.p[0]

    def indicators(self, mesh, solution):
        return np.ones(mesh.nelements)


class Elastic(Even):
    """A problem with two unknowns per node."""

    def solve(self, mesh):
        return mesh.p.ravel()


VALUES, FIXED = np.zeros(3), np.ones(3, dtype=bool)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ka.Ritz(VALUES, FIXED, 1.0, load=1.0), "Ritz has no argument 'load'. Did you mean 'source'?"),
        (
            lambda: ka.Ritz(VALUES, FIXED, coeficient=1.0),
            "Ritz has no argument 'coeficient'. Did you mean 'coefficient'?",
        ),
        (lambda: ka.Ritz(VALUES, FIXED, 1.0, robins={}), "Ritz has no argument 'robins'. Did you mean 'robin'?"),
        (lambda: ka.adapt(MESH, Even(), pases=3), "adapt has no argument 'pases'. Did you mean 'passes'?"),
        (lambda: ka.adapt(MESH, Even(), tolerance=3), "adapt has no argument 'tolerance'. Did you mean 'rtol'?"),
        (lambda: ka.polish(MESH, Even(), sweeeps=3), "polish has no argument 'sweeeps'. Did you mean 'sweeps'?"),
        (lambda: ka.relocate(MESH, sizes=1.0), "relocate has no argument 'sizes'. Did you mean 'density'?"),
        (
            lambda: ka.polish(MESH, Even(), zzz=3),
            "polish has no argument 'zzz'. It has 'curves', 'layers', 'mesh', 'min_quality', 'periodic', 'pinned', "
            "'problem', 'seed', 'surfaces', 'sweeps', 'topology'.",
        ),
    ],
)
def test_the_nearest_keyword_is_named(call, message):
    with pytest.raises(TypeError, match=f"^{re.escape(message)}$"):
        call()


ATTRIBUTES = {  # what it must be
    "points": "a mapping of names to positions of shape (2, n)",
    "pairs": "a sequence of pairs of names of boundaries",
    "order": "the degree of its elements, from 1 to 4 or within its orders",
    "norm": "'energy' or 'L2'",
    "calibrated": "True or False",
    "curved": "True, False or None",
}
METHODS = {  # with its arguments
    "solve_from": "mesh, old_mesh, old_solution",
    "energy_norm": "mesh, solution",
    "ritz": "mesh, solution",
    "curves": "mesh",
    "improved": "mesh, solution, outputs",
}
TAKEN = [
    *(
        (
            name,
            lambda self: None,
            f"{wanted}; Heat has a method of this name. Make the method a property, or rename a method",
        )
        for name, wanted in ATTRIBUTES.items()
    ),
    *(
        (name, {"rim": 1.0}, f"a method {name}({wanted}); Heat has a dict of this name. Rename an attribute")
        for name, wanted in METHODS.items()
    ),
]


@pytest.mark.parametrize("run", [ka.adapt, ka.polish])
@pytest.mark.parametrize(("name", "taken", "said"), TAKEN)
def test_something_else_under_the_name_of_an_attribute_or_a_method(run, name, taken, said):
    message = f"{name} of the problem must be {said} with another purpose."
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        run(MESH, type("Heat", (Even,), {name: taken})())


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"points": [(0.5, 0.5)]}, "points of the problem must be a mapping of names to positions"),
        ({"points": {"a": (0.5, 0.5)}}, "points['a'] of the problem must have shape (2, n); got (2,)."),
        (
            {"pairs": {"left": "right"}},
            "pairs of the problem must be a sequence of pairs of names of boundaries; got {",
        ),
        ({"curves": lambda self, mesh: ["rim"]}, "curves of the problem must return a mapping of boundaries to curves"),
    ],
)
def test_attributes_of_the_wrong_kind(attributes, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        ka.adapt(MESH, type("Heat", (Even,), attributes)())


def test_points_may_be_lists():
    points = {"middle": [[0.5], [0.5]]}
    result = ka.adapt(MESH, type("Heat", (Even,), {"points": points})(), passes=1)
    assert np.any(np.all(result.mesh.p.T == 0.5, axis=1))


def test_vector_problems_are_moved_by_the_map_alone():
    result = ka.adapt(MESH, Elastic(), passes=1)
    assert "No polish: Elastic has no method ritz(mesh, solution); vector problems (several unknowns" in result.message
    assert "cannot be polished" in result.message
    assert "vector problems" not in ka.adapt(MESH, Even(), passes=1).message


def test_a_functional_of_a_vector_problem():
    class Functional(Elastic):
        def ritz(self, mesh, solution):
            return ka.Ritz(solution, np.zeros(solution.size, dtype=bool), 1.0)

    with pytest.raises(ValueError, match=r"must have shape \(nnodes,\) = \(25,\); got \(50,\)\. Ritz has one unknown"):
        ka.polish(MeshTri().refined(2), Functional())
