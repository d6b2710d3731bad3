"""A mesh as arrays: neighbours are scikit-fem's, regions are connected and in order, tangled meshes are refused."""

import numpy as np
import pytest
from helpers.meshes import generic_square, named, perturbed, ring, slit
from numpy.testing import assert_array_equal

from kohonen_adapt.mesh.adjacency import neighbours_of
from kohonen_adapt.mesh.triangulation import Triangulation

MESHES = {"generic": generic_square(9, 3), "ring": ring(12, 3), "slit": slit(8), "named": perturbed(named(8), 1)}


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
def test_neighbours_lie_across_the_edges_opposite_to_corners(mesh):
    elements = Triangulation.of(mesh).elements
    for e in range(mesh.nelements):
        for k in range(3):
            edge = set(elements.node[e].tolist()) - {elements.node[e, k]}
            facet = next(f for f in mesh.t2f[:, e] if set(mesh.facets[:, f].tolist()) == edge)
            across = set(mesh.f2t[:, facet].tolist()) - {e}
            assert across == {elements.neighbour[e, k]}


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
def test_regions_are_connected_sets_of_one_material_in_the_order_of_their_elements(mesh):
    elements = Triangulation.of(mesh).elements
    names = [
        frozenset(name for name, rows in (mesh.subdomains or {}).items() if e in rows) for e in range(mesh.nelements)
    ]
    region, slow, count = elements.region, np.full(mesh.nelements, -1), 0
    for seed in range(mesh.nelements):
        stack = [seed] if slow[seed] < 0 else []
        count += len(stack)
        while stack:
            e = stack.pop()
            slow[e] = count - 1
            stack += [o for o in elements.neighbour[e] if o >= 0 and slow[o] < 0 and names[o] == names[e]]
    assert_array_equal(region, slow)


@pytest.mark.parametrize(
    ("node", "fold"),
    [
        ([[0, 1, 2], [1, 3, 2], [0, 1, 2]], 0),  # doubled
        ([[4, 5, 6], [0, 1, 2], [1, 2, 3]], 1),  # overturned: both run along the edge from 1 to 2
        ([[0, 1, 2], [1, 0, 3], [1, 0, 4]], 0),  # three at one edge
    ],
)
def test_elements_on_one_another_are_refused(node, fold):
    with pytest.raises(ValueError, match=f"tangled: element {fold} shares an edge"):
        neighbours_of(np.array(node, dtype=np.int32), np.zeros((7, 2)))


def test_the_star_follows_the_elements():
    triangulation = Triangulation.of(generic_square(6, 1))
    copy = triangulation.copy()
    for each in (triangulation, copy):
        star = each.star
        for v in range(each.nnodes):
            rows = slice(star.start[v], star.start[v + 1])
            assert star.element[rows].tolist() == np.flatnonzero(np.any(each.elements.node == v, axis=1)).tolist()
            for e, a, b in zip(star.element[rows], star.ahead[rows], star.behind[rows], strict=True):
                k = each.elements.node[e].tolist().index(v)
                assert (a, b) == (each.elements.node[e, (k + 1) % 3], each.elements.node[e, (k + 2) % 3])
