"""The table of the arrays that kernels share says of each array what shape and type it has."""

import inspect
import re

import numpy as np
import pytest
from helpers.meshes import square

from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels import arrays as shared
from kohonen_adapt.kernels.triangle import arrays

ROW = re.compile(r"^    (\w+): Array  # \(([^)]+)\)(?: (int8|int32|int64|bool)\b)?", re.MULTILINE)
NO_ARRAYS = {
    "Constraints": {"chains", "periodic", "metric"},
    "Descent": {"elements", "star", "constraints", "trial", "modes", "reference", "points", "shapes", "block"},
    "Laws": {"first"},
    "Metric": {"relief"},
    "KernelMesh": {"elements", "star", "constraints"},
    "Shapes": {"around"},
    "OpenMesh": {"elements", "constraints", "pool", "origins", "scratch", "metric"},
    "Trial": {"laws"},
    "Trials": {"primal", "dual"},
    "Descents": {"primal", "dual", "terms"},
}
KINDS = {name: kind for module in (shared, arrays) for name, kind in vars(module).items() if hasattr(kind, "_fields")}
RECORDS = ("Elements", "Star", "Constraints", "Chains", "PeriodicPairs", "SearchScratch", "SurgeryScratch")


def table_of(record):
    """Name, shape as written and type of every array of a record."""
    return [(name, shape, kind or "float64") for name, shape, kind in ROW.findall(inspect.getsource(record))]


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
    for field, shape, kind in table_of(KINDS[name]):
        array = getattr(found[name], field)
        wanted = eval(f"({shape.rstrip(',')},)".replace("3 m", "3 * m"), {}, sizes)
        assert array.dtype == np.dtype(kind), field
        assert array.shape == wanted, field


def test_every_array_has_its_row_in_the_table():
    for record in KINDS.values():
        written = {name for name, _, _ in table_of(record)}
        assert written == set(record._fields) - NO_ARRAYS.get(record.__name__, set())
