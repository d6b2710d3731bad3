"""The table of the arrays that kernels share says of each array what shape and type it has."""

import inspect
import re
from typing import get_type_hints

import pytest
from helpers.meshes import square

from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels import arrays as shared
from kohonen_adapt.kernels.triangle import arrays

ROW = re.compile(r"^    (\w+): [RLISB]\d  # \(([^)]+)\)", re.MULTILINE)
KINDS = {name: kind for module in (shared, arrays) for name, kind in vars(module).items() if hasattr(kind, "_fields")}
RECORDS = ("Elements", "Star", "Constraints", "Chains", "PeriodicPairs", "SearchScratch", "SurgeryScratch")


def types_of(record):
    """Type and number of axes of every array of a record, by name."""
    hints = get_type_hints(record, include_extras=True)
    return {name: hint.__metadata__ for name, hint in hints.items() if hasattr(hint, "__metadata__")}


@pytest.fixture(scope="module")
def records():
    """One record of each kind, and the sizes that letters stand for."""
    mesh = square(6).with_defaults().with_subdomains({"low": lambda x: x[1] < 0.5})
    movable = MovableMesh.of(mesh, Rules(periodic=[("left", "right")]))
    tri, constraints = movable.triangulation, movable.constraints
    chains, periodic = constraints.chains, constraints.periodic
    n, m = tri.nnodes, len(tri.elements.node)
    scratch = shared.SearchScratch.of(n, m), arrays.SurgeryScratch.of(n, m)
    sizes = {"n": n, "m": m, "r": 2, "c": len(chains.row) - 1, "k": len(chains.knot), "motions": len(periodic.motions)}
    found = (tri.elements, tri.star, constraints, chains, periodic, *scratch)
    return {type(record).__name__: record for record in found}, sizes | {"CROSSINGS": shared.CROSSINGS}


@pytest.mark.parametrize("name", RECORDS)
def test_the_table_says_what_there_is(records, name):
    found, sizes = records
    shapes = dict(ROW.findall(inspect.getsource(KINDS[name])))
    for field, (kind, axes) in types_of(KINDS[name]).items():
        array = getattr(found[name], field)
        wanted = eval(f"({shapes[field].rstrip(',')},)".replace("3 m", "3 * m"), {}, sizes)
        assert (str(array.dtype), array.ndim) == (str(kind), axes), field
        assert array.shape == wanted, field


def test_every_array_has_its_row_in_the_table():
    for record in KINDS.values():
        assert {name for name, _ in ROW.findall(inspect.getsource(record))} == set(types_of(record))
