"""Periodic pairs: boundaries that are one another's image stay so, node by node, and a point reaches across them."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.meshes import square
from scipy.sparse import csr_array
from scipy.sparse.linalg import spsolve
from scipy.spatial import KDTree
from skfem import Basis, ElementTriP0, ElementTriP1, LinearForm, MeshTri
from skfem.models import laplace

import kohonen_adapt as ka
from kohonen_adapt import KohonenMap, Schedule, Stage

SIDES = {
    "left": lambda x: x[0] == 0.0,
    "right": lambda x: x[0] == 1.0,
    "bottom": lambda x: x[1] == 0.0,
    "top": lambda x: x[1] == 1.0,
}
BOTH = [("left", "right"), ("bottom", "top")]


def cell(n):
    """A unit square with names on its sides, and a band across it that is another material."""
    mesh = square(n).with_boundaries(SIDES)
    return mesh.with_subdomains({"band": lambda x: np.abs(x[1] - 0.5) < 0.25})


def sector(n, angle, inner=0.4):
    """A sector of a ring about the point (2, 1), its straight sides named."""
    unit = square(n)
    radius, turn = inner + (1.0 - inner) * unit.p[0], angle * unit.p[1] + 0.3
    mesh = MeshTri(np.stack([2.0 + radius * np.cos(turn), 1.0 + radius * np.sin(turn)]), unit.t)
    return mesh.with_boundaries(
        {"first": unit.facets_satisfying(lambda x: x[1] == 0), "last": unit.facets_satisfying(lambda x: x[1] == 1)}
    )


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def mismatch(mesh, one, other, motion):
    """How far the moved nodes of one boundary are from those of the other; each is to have one of its own."""
    nodes, others = (np.unique(mesh.facets[:, mesh.boundaries[name]]) for name in (one, other))
    off, partner = KDTree(mesh.p[:, others].T).query(motion(mesh.p[:, nodes]).T)
    assert len(nodes) == len(others) == len(np.unique(partner))
    return off.max()


def peak_at(x, y):
    """A density with a steep peak."""
    return lambda points: 1.0 / (0.03 + np.hypot(points[0] - x, points[1] - y)) ** 2


@pytest.mark.parametrize("topology", ["fixed", "flip", "recycle"])
def test_translated_sides_stay_matched(topology):
    mesh = cell(16)
    for seed in range(5):
        mesh = ka.relocate(mesh, peak_at(0.0, 0.3), topology=topology, periodic=BOTH, seed=seed)
        assert mismatch(mesh, "left", "right", lambda x: x + [[1.0], [0.0]]) < 1e-15
        assert mismatch(mesh, "bottom", "top", lambda x: x + [[0.0], [1.0]]) < 1e-15
    sides = [np.unique(mesh.facets[:, mesh.boundaries[name]]) for name in SIDES]
    assert [len(nodes) for nodes in sides] == [17] * 4
    assert np.sort(mesh.p[1, sides[0]])[8] < 0.45  # they went to the peak
    assert ka.relocate(cell(16), peak_at(0.0, 0.3), seed=0).boundaries.keys() == mesh.boundaries.keys()


def test_without_pairs_the_sides_part():
    mesh = ka.relocate(cell(16), peak_at(0.0, 0.3), topology="fixed")
    with pytest.raises(ValueError, match="Mesh them as a pair"):
        KohonenMap(mesh, periodic=[("left", "right")])


@pytest.mark.parametrize("angle", [0.5, np.pi / 4, np.pi / 2, 2.0])
@pytest.mark.parametrize("topology", ["flip", "recycle"])
def test_rotated_sides_stay_matched(angle, topology):
    mesh, turn, centre = sector(14, angle), rotation(angle), np.array([[2.0], [1.0]])
    x, y = 2.0 + 0.5 * np.cos(0.3), 1.0 + 0.5 * np.sin(0.3)
    for seed in range(5):
        mesh = ka.relocate(mesh, peak_at(x, y), topology=topology, periodic=[("first", "last")], seed=seed)
        assert mismatch(mesh, "first", "last", lambda p: turn @ (p - centre) + centre) < 1e-14


def test_which_way_round_a_pair_is_named_does_not_matter_for_the_match():
    mesh = ka.relocate(cell(12), peak_at(1.0, 0.3), periodic=[("right", "left")])
    assert mismatch(mesh, "left", "right", lambda x: x + [[1.0], [0.0]]) < 1e-15


def test_a_point_beside_one_side_reaches_what_lies_beside_the_other():
    mesh = square(8).with_boundaries(SIDES)
    x, near = np.array([[0.02], [0.47]]), np.flatnonzero((mesh.p[0] == 0.875) & (mesh.p[1] == 0.5))
    once = Schedule((Stage(1, 1, 0.5, neighbourhood="flat"),))
    alone, paired = KohonenMap(mesh, topology="fixed"), KohonenMap(mesh, topology="fixed", periodic=[("left", "right")])
    alone.train(x, once)
    paired.train(x, once)
    np.testing.assert_array_equal(alone.mesh.p[:, near], mesh.p[:, near])
    # ring 1 of the winner's partner goes half of its way to the image of the point
    np.testing.assert_allclose(paired.mesh.p[:, near], 0.5 * (mesh.p[:, near] + x + [[1.0], [0.0]]), atol=1e-15)
    assert mismatch(paired.mesh, "left", "right", lambda p: p + [[1.0], [0.0]]) == 0.0


def test_both_stars_of_a_pair_are_guarded():
    """On the right a thin layer of elements leaves little room; the nodes on the left stop with their partners."""
    mesh = square(8).with_boundaries(SIDES)
    p = mesh.p.copy()
    p[0, p[0] == 0.875] = 0.99
    mesh = MeshTri(p, mesh.t, mesh.boundaries)
    result = ka.relocate(mesh, peak_at(0.0, 0.0), periodic=[("left", "right")], topology="fixed", min_quality=0.05)
    assert mismatch(result, "left", "right", lambda x: x + [[1.0], [0.0]]) < 1e-15
    assert ka.quality(result).min() >= min(0.05, ka.quality(mesh).min())


def test_interfaces_that_end_on_one_side_hold_their_partners():
    """The band ends on the left side only: its ends are corners there, so the nodes opposite are held, too."""
    mesh = square(16).with_boundaries(SIDES)
    mesh = mesh.with_subdomains({"band": lambda x: (np.abs(x[1] - 0.5) < 0.25) & (x[0] < 0.5)})
    result = ka.relocate(mesh, peak_at(0.0, 0.3), periodic=[("left", "right")])
    for name in ("left", "right"):
        assert {0.25, 0.75} <= {*result.p[1, np.unique(result.facets[:, result.boundaries[name]])].tolist()}
    assert mismatch(result, "left", "right", lambda x: x + [[1.0], [0.0]]) < 1e-15


def test_a_pinned_node_pins_its_partner():
    mesh = square(8).with_boundaries(SIDES)
    node = int(np.flatnonzero((mesh.p[0] == 0.0) & (mesh.p[1] == 0.375))[0])
    result = ka.relocate(mesh, peak_at(0.0, 0.0), periodic=[("left", "right")], pinned=[node])
    assert 0.375 in result.p[1, result.p[0] == 1.0]


@pytest.mark.slow
def test_the_mesh_does_not_depend_on_the_number_of_threads():
    """Numba fixes the number of threads at import, so in processes of their own."""
    code = """
from test_pairs import BOTH, cell, ka, peak_at
print(ka.relocate(cell(48), peak_at(0.0, 0.3), periodic=BOTH).p.tobytes().hex())
"""
    here = Path(__file__).parent
    path = os.pathsep.join([str(here), str(here.parent), str(here.parents[1])])
    said = set()
    for threads in ("1", "3"):
        environment = {**os.environ, "NUMBA_NUM_THREADS": threads, "PYTHONPATH": path}
        done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
        said.add(done.stdout)
    assert len(said) == 1
    moved = np.frombuffer(bytes.fromhex(said.pop())).reshape(2, -1)
    np.testing.assert_array_equal(moved, ka.relocate(cell(48), peak_at(0.0, 0.3), periodic=BOTH).p)


class Cell:
    """-div grad u = f, the load f in a spot beside the left side; u periodic in x, zero at the top and the bottom."""

    def load(self, mesh):
        return np.bincount(mesh.subdomains["spot"], minlength=mesh.nelements).astype(float)

    def solve(self, mesh):
        basis = Basis(mesh, ElementTriP1())
        nodes = [np.unique(mesh.facets[:, mesh.boundaries[name]]) for name in ("left", "right")]
        left, right = (rows[np.argsort(mesh.p[1, rows])] for rows in nodes)
        number = np.arange(mesh.p.shape[1])
        number[right] = left
        kept, column = np.unique(number, return_inverse=True)
        join = csr_array((np.ones(len(number)), (np.arange(len(number)), column)))
        source = basis.with_element(ElementTriP0()).interpolate(self.load(mesh))
        matrix, load = join.T @ laplace.assemble(basis) @ join, join.T @ spot_load.assemble(basis, f=source)
        inner = (mesh.p[1, kept] > 0.0) & (mesh.p[1, kept] < 1.0)
        u = np.zeros(len(kept))
        u[inner] = spsolve(matrix[inner][:, inner].tocsc(), load[inner])
        return join @ u

    def indicators(self, mesh, solution):
        return ka.estimators.residual(mesh, solution, np.ones(mesh.nelements), source=self.load(mesh))

    def ritz(self, mesh, solution):
        fixed = (mesh.p[1] == 0.0) | (mesh.p[1] == 1.0)
        return ka.Ritz(solution, fixed, 1.0, source=np.array([0.0, 1.0]), region=self.load(mesh).astype(int))


@LinearForm
def spot_load(v, w):
    return w.f * v


@pytest.mark.parametrize("topology", ["flip", "recycle"])
def test_a_loop_keeps_them_matched_and_lowers_the_estimate(topology):
    mesh = square(16).with_boundaries(SIDES)
    mesh = mesh.with_subdomains({"spot": lambda x: (x[0] < 0.125) & (np.abs(x[1] - 0.5) < 0.125)})
    result = ka.adapt(mesh, Cell(), passes=3, periodic=[("left", "right")], topology=topology)
    assert mismatch(result.mesh, "left", "right", lambda x: x + [[1.0], [0.0]]) < 1e-14
    assert result.estimate < 0.9 * result.history[0].estimate


@pytest.mark.parametrize(
    ("periodic", "message"),
    [
        ("lr", r"periodic must hold pairs of names of boundaries, as \[\('left', 'right'\)\]; got 'lr'\."),
        ([("left",)], r"periodic must hold pairs of names"),
        ([("left", "east")], r"periodic has 'east', which is no boundary of the mesh; its boundaries are: 'bottom',"),
        ([("left", "right"), ("left", "top")], r"boundary 'left' is in periodic twice; it can have one partner only\."),
        ([("left", "left")], r"boundary 'left' is in periodic twice"),
    ],
)
def test_bad_pairs_are_refused(periodic, message):
    with pytest.raises(ValueError, match=message):
        ka.relocate(cell(4), np.ones(32), periodic=periodic)


def test_sides_that_do_not_match_are_refused():
    mesh = square(8).with_boundaries(
        {**SIDES, "seam": lambda x: x[0] == 0.5, "half": lambda x: (x[0] == 1) & (x[1] < 0.5)}
    )
    with pytest.raises(ValueError, match="'left' and 'half' must have as many nodes; they have 9 and 5"):
        ka.relocate(mesh, np.ones(128), periodic=[("left", "half")])
    with pytest.raises(ValueError, match="'seam' must lie on the outer boundary"):
        ka.relocate(mesh, np.ones(128), periodic=[("left", "seam")])
    p = mesh.p.copy()
    p[1, (p[0] == 1.0) & (p[1] == 0.25)] += 1e-3
    with pytest.raises(
        ValueError, match=r"within 1e-08 of the size of the mesh, .*; the nearest is 0\.001 off\. Mesh them"
    ):
        ka.relocate(MeshTri(p, mesh.t, mesh.boundaries), np.ones(128), periodic=[("left", "right")])


def test_a_curve_and_a_partner_do_not_go_together():
    with pytest.raises(ValueError, match="a periodic boundary cannot have a curve, too"):
        ka.relocate(cell(4), np.ones(32), periodic=[("left", "right")], curves={"left": ka.Line((0, 0), (0, 1))})
