"""Swaps and recycling by energy on tetrahedra: worth what slow twins say, and a functional that falls as told."""

import numpy as np
import pytest
from helpers.boxes import qualities
from helpers.boxes import volumes as volumes_of
from helpers.descents import descent_of
from helpers.examples import examples
from helpers.solids import box, cut, l_shape, two_regions, volumes
from hypothesis import given
from hypothesis import strategies as st
from skfem import MeshTet

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.tetrahedron.arrays import INSIDE, SOURCE_24TH
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES
from kohonen_adapt.magnetostatics import Froehlich
from kohonen_adapt.mesh.elements.polynomials import TrialFunction
from kohonen_adapt.polishing.space import recycling_in_space
from kohonen_adapt.polishing.space.recycling_in_space import nodes_of
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional

FLOOR = 0.2
MESHES = {
    "box": lambda: box(3, 4, 3),
    "regions": lambda: two_regions(4),
    "sheet": lambda: cut(4),
    "L": lambda: l_shape(2),
}


class Setting:
    """A mesh with a functional that changes from region to region and a rough function, opened for surgery."""

    def __init__(self, mesh, seed=0, *, values=None, fixed=None, bent=False, pinned=(), load=1.0):
        rng, x = np.random.default_rng(seed), mesh.p
        self.mesh, self.movable = mesh, MovableSolid.of(mesh, Rules("recycle", FLOOR, pinned))
        region = self.movable.tetrahedralization.elements.region
        count = region.max() + 1
        centre = rng.random((3, 1)) * x.max()
        bumps = np.exp(-20.0 * ((x - centre) ** 2).sum(axis=0)) + 0.02 * rng.normal(size=x.shape[1])
        at_left = x[0] == 0.0
        self.ritz = ka.Ritz(
            np.where(at_left, x[1], bumps) if values is None else values,
            at_left if fixed is None else fixed,
            10.0 ** rng.uniform(-1, 1, count),
            load * rng.normal(size=count),
            load * rng.normal(size=(3, count)),
            region,
            [Froehlich(4.0, 2.1) if number == 0 else None for number in range(count)] if bent else (),
        )
        self.functional = SolidFunctional.of(self.ritz, self.movable, mesh)
        self.descent = descent_of(self.movable, self.functional)
        self.opened, self.trial = self.descent.opened, self.descent.trial

    def swap(self):
        return self.descent.swap(self.opened.parts())

    def recycle(self):
        return self.descent.recycle()

    def offers(self):
        return self.descent.weigh(nodes_of(self.opened.mesh)).offers

    def value(self):
        """The functional of what there is now, worked out from the mesh that is handed back."""
        solid = self.movable.copy()
        rows = self.opened.write_back(solid)
        function = TrialFunction(self.trial.value[rows], self.trial.fixed[rows], None)
        return self.functional.value(solid.tetrahedralization, function)

    def handed_back(self):
        """The mesh, and which values are given there."""
        rows = self.opened.write_back(self.movable)
        return self.movable.mesh(), self.trial.value[rows], self.trial.fixed[rows]


def perturbed(mesh, seed, amount=0.3):
    """The mesh with inner nodes moved, none of them on a plane at 0, 1/2, 1 or 2."""
    p, rng = mesh.p.copy(), np.random.default_rng(seed)
    inner = ~np.isin(p, [0.0, 0.5, 1.0, 2.0]).any(axis=0)
    step = amount * p.max() / round(mesh.nvertices ** (1 / 3))
    p[:, inner] += rng.uniform(-step, step, (3, inner.sum())) / 2
    return MeshTet(p, mesh.t, _boundaries=mesh.boundaries, _subdomains=mesh.subdomains)


def measures(mesh):
    """Volumes of subdomains, areas of boundaries, and which of them are in planes across an axis."""
    sizes = {name: np.abs(volumes(mesh)[rows]).sum() for name, rows in (mesh.subdomains or {}).items()}
    planes = {}
    for name, facets in (mesh.boundaries or {}).items():
        corners = mesh.p[:, mesh.facets[:, np.asarray(facets)]]
        a, b, c = corners.transpose(1, 2, 0)
        sizes["of " + name] = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
        planes[name] = (np.ptp(corners, axis=(1, 2)) == 0.0).tolist()
    return {**sizes, "all": np.abs(volumes(mesh)).sum()}, planes


@examples(12)
@given(
    st.sampled_from(sorted(MESHES)),
    st.integers(0, 1000),
    st.booleans(),
    st.booleans(),
    st.lists(st.sampled_from(["swap", "recycle"]), min_size=2, max_size=4),
)
def test_the_functional_falls_by_what_is_told_and_all_that_is_to_stay_stays(name, seed, bent, pinned, steps):
    mesh = perturbed(MESHES[name](), seed)
    inner = np.flatnonzero((mesh.p > 0.0).all(axis=0) & (mesh.p < mesh.p.max()).all(axis=0))
    held = inner[:: 3 if pinned else len(inner)]
    at = Setting(mesh, seed, bent=bent, pinned=held)
    before = at.value()
    for step in steps:
        told = at.swap() if step == "swap" else at.recycle()[1]
        after = at.value()
        assert told >= 0.0 or step == "recycle"
        assert before - after == pytest.approx(told, rel=1e-8, abs=1e-10 if bent else 1e-12)
        before = after
    found, _, _ = at.handed_back()
    assert found.nvertices == mesh.nvertices and found.is_valid()
    assert ka.quality(found).min() >= min(FLOOR, ka.quality(mesh).min()) * (1 - 1e-9)
    (sizes, planes), (now, still) = measures(mesh), measures(found)
    assert now == pytest.approx(sizes, rel=1e-12) and still == planes
    places = {tuple(place) for place in found.p.T}
    assert all(tuple(place) in places for place in mesh.p.T[held])


def test_recycling_goes_on_where_rows_of_nodes_are_used_again():
    """A bump in a corner of a fine mesh: a fifth of the nodes goes there, and what is told is what happens."""
    mesh = box(7)
    at = Setting(mesh, 3, values=np.exp(-60.0 * ((mesh.p - 0.8) ** 2).sum(axis=0)), fixed=mesh.p[0] == 0.0, load=0.0)
    before, pairs, told = at.value(), 0, 0.0
    for _ in range(3):
        more, decrease = at.recycle()
        pairs, told = pairs + more, told + decrease
    assert pairs > 0.2 * mesh.nvertices
    assert before - at.value() == pytest.approx(told, rel=1e-10)
    found, values, _ = at.handed_back()
    assert found.nvertices == mesh.nvertices == len(values) and found.is_valid()


def slow(at, made, set_origins, p=None, value=0.0):
    """The functional of elements made of others, with that value at node p."""
    values, mesh = at.trial.value.copy(), at.opened.mesh
    if p is not None:
        values[p] = value
    region = at.functional.number[mesh.elements.region[set_origins]]
    corners = mesh.position[made]
    planes = np.dstack([corners, np.ones(made.shape)])
    gradient = np.linalg.solve(planes, values[made][..., None])[:, :3, 0]
    ritz = at.ritz
    density = 0.5 * ritz.coefficient[region] * np.sum(gradient**2, axis=1) - ritz.source[region] * values[made].mean(
        axis=1
    )
    density -= np.sum(ritz.flux[:, region].T * gradient, axis=1)
    return float(volumes_of(mesh.position, made) @ density)


@pytest.mark.parametrize("name", sorted(MESHES))
def test_gains_of_splits_are_those_of_a_slow_twin(name):
    """The least of a parabola through three values of the new node, on halves made anew."""
    at = Setting(perturbed(MESHES[name](), 1), 1)
    gains, mesh, checked = at.offers().gain, at.opened.mesh, 0
    node = mesh.elements.node
    for e, k in zip(*np.nonzero(gains > 0.02 * gains.max()), strict=True):
        a, b = node[e, EDGES[k, :2]]
        shell = np.flatnonzero((node[:, 0] >= 0) & (node == a).any(axis=1) & (node == b).any(axis=1))
        p = len(mesh.position) - 1  # a row to spare
        mesh.position[p] = 0.5 * (mesh.position[a] + mesh.position[b])
        halves = np.array([np.where(node[i] == end, p, node[i]) for i in shell for end in (a, b)])
        assert qualities(mesh.position, halves).min() >= min(FLOOR, qualities(mesh.position, node[shell]).min())
        low, middle, high = (
            slow(at, halves, np.repeat(shell, 2), p, 0.5 * at.trial.value[[a, b]].sum() + w) for w in (-1, 0, 1)
        )
        assert gains[e, k] == pytest.approx(0.125 * (high - low) ** 2 / (high + low - 2 * middle), rel=1e-6)
        checked += 1
    assert checked > 5


@pytest.mark.parametrize("name", sorted(MESHES))
def test_costs_of_collapses_are_those_of_a_slow_twin(name):
    """Of nodes inside the least over all neighbours that leave good elements which fill the same space."""
    at = Setting(perturbed(MESHES[name](), 2), 2)
    offers, mesh = at.offers(), at.opened.mesh
    node, checked = mesh.elements.node, 0
    most = offers.gain.max() / recycling_in_space.MARGIN[0]
    for v in np.flatnonzero((mesh.freedom.number == INSIDE) & (mesh.pool.anchor >= 0)):
        least, star = most, np.flatnonzero((node[:, 0] >= 0) & (node == v).any(axis=1))
        for w in set(node[star].ravel().tolist()) - {v}:
            left = star[~(node[star] == w).any(axis=1)]
            made = np.where(node[left] == v, w, node[left])
            worst = qualities(mesh.position, made).min()
            full = volumes_of(mesh.position, made).sum() == pytest.approx(volumes_of(mesh.position, node[star]).sum())
            if worst >= min(FLOOR, qualities(mesh.position, node[star]).min()) and full:
                least = min(least, slow(at, made, left) - slow(at, node[star], star))
        assert offers.cost[v] == pytest.approx(least if least < most else np.inf, rel=1e-6)
        checked += least < most
    assert checked > 3


@pytest.mark.parametrize("curved", [False, True], ids=["linear", "not linear"])
def test_given_values_stay_what_they_are(curved):
    """Where they are linear along a face of the cube nodes may leave it; where they are not, all of it stays."""
    mesh = box(5)
    left = mesh.p[0] == 0.0
    given = 2.0 * mesh.p[1] - mesh.p[2] + curved * mesh.p[1] ** 2
    bump = np.exp(-60.0 * ((mesh.p - 0.75) ** 2).sum(axis=0))
    at = Setting(mesh, values=np.where(left, given, given + bump), fixed=left, load=0.0)
    for _ in range(3):
        at.swap()
        at.recycle()
    found, values, fixed = at.handed_back()
    assert np.array_equal(fixed, found.p[0] == 0.0)
    y, z = found.p[1:, fixed]
    assert values[fixed] == pytest.approx(2.0 * y - z + curved * y**2, abs=1e-14)
    faces = [
        {tuple(sorted(map(tuple, m.p[1:, f].T.tolist()))) for f in m.facets.T if np.all(m.p[0, f] == 0.0)}
        for m in (mesh, found)
    ]
    assert (faces[0] == faces[1]) == curved


def test_nothing_is_split_between_nodes_given_inside():
    """Who knows what values are given between them."""
    mesh = box(5)
    line = (mesh.p[0] == 0.4) & (mesh.p[1] == 0.4)
    at = Setting(mesh, values=np.random.default_rng(0).normal(size=mesh.nvertices), fixed=line)
    gain, node = at.offers().gain, at.opened.mesh.elements.node
    e, k = np.nonzero(gain)
    ends = node[e[:, None], EDGES[k, :2]]
    assert len(e) and not np.any(at.trial.fixed[ends].all(axis=1))
    at.recycle()
    _, _, fixed = at.handed_back()
    assert fixed.sum() == line.sum()


def test_a_source_by_node_and_one_by_region_of_the_same_value_exchange_nodes_alike():
    one, other = (Setting(two_regions(4), load=30.0) for _ in range(2))
    load = one.trial.data[:, SOURCE_24TH].copy()
    other.trial = other.trial._replace(
        data=one.trial.data * np.where(np.arange(9) == SOURCE_24TH, 0.0, 1.0),
        source=np.tile(load, (len(one.trial.value), 1)),
    )
    pairs, decrease = one.recycle()
    assert pairs > 0 and (pairs, decrease) == other.recycle()
    np.testing.assert_array_equal(one.trial.value, other.trial.value)
    np.testing.assert_array_equal(other.trial.source, np.tile(load, (len(one.trial.value), 1)))
