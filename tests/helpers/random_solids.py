"""Random bodies of tetrahedra with random names, flat and round ones, and how they are to be relocated."""

import numpy as np
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay
from skfem import MeshTet
from skfem.generic_utils import OrientedBoundary

import kohonen_adapt as ka
from helpers.solids import cut as with_sheet
from helpers.solids import l_shape, named, two_regions
from kohonen_adapt import Schedule, Stage

SCHEDULES = [
    None,
    None,
    Schedule(()),
    Schedule((), sweeps=5),
    Schedule((Stage(1, 2, (1.0, 0.3)),), sweeps=1),
]


@st.composite
def flat_solids(draw):
    """A body with plane faces only, a density on it, and how it is to be relocated."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    kind = draw(st.sampled_from([cells, scattered, cuboids]))
    mesh = coarse = kind(rng)
    if kind is not cuboids:
        coarse = cut(coarse, rng) if draw(st.booleans()) else coarse
        mesh = named_at_random(coarse, rng) if draw(st.booleans()) else coarse.refined(1)
    return mesh, density_at_random(mesh, rng, draw), options_at_random(mesh, rng, draw)


@st.composite
def round_solids(draw):
    """A body with a round side of a known shape, its surface, a density on it, and how it is to be relocated."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    mesh, surface = draw(st.sampled_from([ball, bar, cone]))(draw(st.sampled_from([4, 6])))
    told = {"side": Projection(surface) if draw(st.booleans()) else surface}
    options = options_at_random(mesh, rng, draw)
    return mesh, surface, density_at_random(mesh, rng, draw), {**options, "surfaces": told}


class Projection:
    """A surface of which nothing is known but how points are projected on it."""

    def __init__(self, surface):
        self.project = surface.project


def density_at_random(mesh, rng, draw):
    """Of every element for itself, or most around a point."""
    height = draw(st.sampled_from([0, 1, 3, 6]))
    if draw(st.booleans()):
        return 10 ** (rng.random(mesh.t.shape[1]) * height)
    x = mesh.p[:, mesh.t].mean(axis=1)
    squares = np.sum((x - x[:, [rng.integers(x.shape[1])]]) ** 2, axis=0)
    return 1.0 + 10**height * np.exp(-10.0 * squares / np.ptp(mesh.p) ** 2)


def options_at_random(mesh, rng, draw):
    pinned = rng.integers(0, mesh.p.shape[1], draw(st.integers(0, 3))).tolist()
    if "a" in (mesh.boundaries or {}) and draw(st.booleans()):
        pinned.append("a")
    return {
        "topology": draw(st.sampled_from(["fixed", "flip", "recycle"])),
        "min_quality": draw(st.sampled_from([0.0, 0.1, "auto", 0.5])),
        "schedule": draw(st.sampled_from(SCHEDULES)),
        "pinned": pinned,
        "seed": draw(st.integers(0, 1000)),
    }


def cells(rng):
    """Some cells of a grid, turned, sheared and cut in six: holes, pinches and parts that hang together nowhere."""
    mesh = MeshTet.init_tensor(*(np.arange(rng.integers(2, 5), dtype=float) for _ in range(3)))
    cell = np.floor(mesh.p[:, mesh.t].mean(axis=1)).T @ [16, 4, 1]
    gone = rng.random(64) < rng.uniform(0, 0.4)
    gone[0] = False
    mesh = mesh.remove_elements(np.flatnonzero(gone[cell.astype(int)]))
    stretch = np.triu(rng.uniform(-0.5, 0.5, (3, 3)), 1) + np.diag(rng.uniform(0.3, 3.0, 3))
    matrix = turn(rng) @ stretch if rng.random() < 0.5 else np.eye(3)
    return MeshTet(matrix @ mesh.p, mesh.t)


def cuboids(rng):
    """Bodies of one or two regions of more elements, with names on whole planes and a sheet inside."""
    return [two_regions, with_sheet, l_shape][rng.integers(3)](int(rng.choice([2, 4])))


def turn(rng):
    """A rotation of space."""
    turned, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return turned


def scattered(rng):
    """A part of a tetrahedralization of random points, slivers included: the outline turns at every edge."""
    p = rng.random((3, rng.integers(5, 13)))
    mesh = MeshTet(p, np.ascontiguousarray(Delaunay(p.T).simplices.T))
    worth = (ka.quality(mesh) > 1e-2) & (rng.random(mesh.t.shape[1]) < rng.uniform(0.5, 1.2))
    worth[np.argmax(ka.quality(mesh))] = True
    return mesh.remove_elements(np.flatnonzero(~worth))


def cut(mesh, rng):
    """The mesh cut open along some of its facets: the nodes there are one per bank, as on slits."""
    whole = np.flatnonzero((mesh.f2t[1] >= 0) & (rng.random(mesh.facets.shape[1]) > rng.uniform(0, 0.3)))
    rows, columns = [], []
    for corner in mesh.facets[:, whole]:
        for across, ends in zip(mesh.f2t[:, whole], (rows, columns), strict=True):
            ends.append(np.argmax(mesh.t[:, across] == corner, axis=0) * mesh.t.shape[1] + across)
    links = coo_array(
        (np.ones(mesh.facets[:, whole].size), (np.concatenate(rows), np.concatenate(columns))), 2 * (mesh.t.size,)
    )
    node = connected_components(links, directed=False)[1]
    first = np.unique(node, return_index=True)[1]
    return type(mesh)(mesh.p[:, mesh.t.ravel()[first]], node.reshape(len(mesh.t), -1))


def named_at_random(coarse, rng):
    """The mesh refined once, with overlapping subdomains and boundaries of whole facets of the coarse one."""
    groups = {"b": np.flatnonzero(rng.random(coarse.t.shape[1]) < 0.3)}
    if rng.random() < 0.5:
        groups["empty"] = np.array([], dtype=np.int64)
    mesh = coarse.with_subdomains(groups).refined(1)
    return named(mesh, {name: facets_at_random(coarse, mesh, rng) for name in ("a", "c", "sided")})


def facets_at_random(coarse, mesh, rng):
    """The quarters of some facets of the coarse mesh, each with a side or all without."""
    n = coarse.p.shape[1]
    ends = np.hstack([np.tile(np.arange(n), (2, 1)), coarse.edges])  # of the edge that every node is the middle of
    chosen = coarse.facets[:, rng.random(coarse.facets.shape[1]) < rng.uniform(0, 0.5)]
    chosen = set(map(tuple, np.sort(chosen, axis=0).T.tolist()))
    corners = ends[:, mesh.facets].reshape(6, -1).T.tolist()
    rows = np.array([f for f, found in enumerate(corners) if tuple(sorted(set(found))) in chosen], dtype=np.int64)
    if rng.random() < 0.5:
        return rows
    return OrientedBoundary(rows, np.where(mesh.f2t[1, rows] >= 0, rng.integers(0, 2, len(rows)), 0))


def ball(n):
    """A ball whose surface is the boundary "side"."""
    x = 2.0 * MeshTet.init_tensor(*[np.linspace(0, 1, n + 1)] * 3).p - 1.0
    length = np.linalg.norm(x, axis=0)
    scale = np.abs(x).max(axis=0) / np.where(length > 0.0, length, 1.0)
    return around(n, n, scale * x, lambda x: np.full(x.shape[2], True)), ka.Sphere((0, 0, 0), 1.0)


def bar(n):
    """A round bar with plane ends, whose round side is the boundary "side"."""
    mesh = MeshTet.init_tensor(*[np.linspace(-1, 1, n + 1)] * 2, np.linspace(0, 1, 3))
    return around(n, 2, rounded(mesh.p), lambda x: np.ptp(x[2], axis=0) > 0), ka.Cylinder((0, 0, 0), (0, 0, 2), 1.0)


def cone(n):
    """A round body that becomes thinner, with plane ends."""
    mesh = MeshTet.init_tensor(*[np.linspace(-1, 1, n + 1)] * 2, np.linspace(0, 1, 3))
    x = rounded(mesh.p)
    x[:2] *= 1.0 - 0.5 * x[2]
    apex, axis, half = (0, 0, 2), (0, 0, -1), np.arctan(0.5)
    return around(n, 2, x, lambda x: np.ptp(x[2], axis=0) > 0), ka.Cone(apex, axis, half)


def rounded(p):
    """Squares about the z axis made discs."""
    x, length = p[:2], np.linalg.norm(p[:2], axis=0)
    return np.vstack([x * np.abs(x).max(axis=0) / np.where(length > 0.0, length, 1.0), p[2]])


def around(n, layers, p, side):
    """A box of cells with its nodes at other places, the facets outside for which `side` says so of their corners
    named, the others with another name, and one half of it a subdomain.
    """
    mesh = MeshTet.init_tensor(*[np.linspace(-1, 1, n + 1)] * 2, np.linspace(0, 1, layers + 1))
    found = MeshTet(p, mesh.t).with_subdomains({"half": np.flatnonzero(mesh.p[0][mesh.t].mean(axis=0) > 0)})
    facets = found.boundary_facets()
    chosen = side(p[:, found.facets[:, facets]])
    return named(found, {"side": facets[chosen], "a": facets[~chosen]})
