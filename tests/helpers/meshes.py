"""Meshes that the tests share: regular, bad, concave, with slits, holes, several regions and names."""

from itertools import pairwise

import numpy as np
from scipy.spatial import Delaunay
from skfem import MeshTri
from skfem.generic_utils import OrientedBoundary


def square(n, low=0.0, high=1.0):
    """n x n squares, cut in halves."""
    ticks = np.linspace(low, high, n + 1)
    return MeshTri.init_tensor(ticks, ticks)


def generic_square(n, seed=0):
    """A Delaunay mesh of the unit square: corners, random outline nodes and random inner nodes."""
    rng = np.random.default_rng(seed)
    side = np.linspace(0, 1, n + 1)[1:-1] + rng.uniform(-0.3, 0.3, n - 1) / n
    zero, one = np.zeros(n - 1), np.ones(n - 1)
    edges = [np.array(pair) for pair in ((side, zero), (side, one), (zero, side), (one, side))]
    inner = rng.uniform(0.3 / n, 1 - 0.3 / n, (2, (n - 1) ** 2))
    p = np.hstack([np.array([[0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]]), *edges, inner])
    return without_flat_elements(p, Delaunay(p.T).simplices.T)


def without_flat_elements(p, t):
    """A mesh of these elements but for those that three nodes in a line gave."""
    x, y = p[:, t]
    doubled = np.abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))
    return MeshTri(p, np.ascontiguousarray(t[:, doubled > 1e-12]))


def disk(rings, radius):
    """A disk of `rings` rings of 6 k nodes."""
    return disk_of(radius * np.arange(1, rings + 1) / rings)


def disk_of(radii):
    """A disk with 6 k nodes on the k-th of its circles."""
    rings = len(radii)
    first = np.cumsum([0, 1, *(6 * k for k in range(1, rings + 1))])
    points, elements = [np.zeros((2, 1))], []
    for k in range(1, rings + 1):
        points.append(radii[k - 1] * circle(6 * k))
        side, step = np.divmod(np.arange(6 * k), k)
        out, follower = first[k] + np.arange(6 * k), first[k] + np.arange(1, 6 * k + 1) % (6 * k)
        inside = first[k - 1] + (side * (k - 1) + step) % max(6 * (k - 1), 1)
        elements.append((out, follower, inside))
        more = step < k - 1
        after = first[k - 1] + (side * (k - 1) + step + 1) % max(6 * (k - 1), 1)
        elements.append((inside[more], after[more], follower[more]))
    return MeshTri(np.hstack(points), np.hstack([np.stack(part) for part in elements]))


def ring(n, layers, inner=0.5, outer=1.0):
    """An annulus about the origin with n nodes on each of its circles, which are named inner and outer."""
    around = circle(n)
    mesh = shells([inner * around, outer * around], layers)
    last = n * layers
    return with_lines(mesh, {"inner": closed(np.arange(n)), "outer": closed(np.arange(last, last + n))})


def circle(n, begin=0.0):
    """n points around the unit circle, (2, n)."""
    angle = begin + 2 * np.pi * np.arange(n) / n
    return np.stack([np.cos(angle), np.sin(angle)])


def shells(rows, layers):
    """A mesh between closed rows of points (2, n), one around the other, in so many layers from each to the next."""
    share = np.arange(layers) / layers
    between = [((1 - s) * a + s * b) for a, b in pairwise(rows) for s in share]
    n = rows[0].shape[1]
    k, first = np.meshgrid(np.arange(n), n * np.arange(len(between)))
    a, b, c, d = (x.ravel() for x in (first + k, first + (k + 1) % n, first + n + k, first + n + (k + 1) % n))
    return MeshTri(np.hstack([*between, rows[-1]]), np.hstack([np.stack([a, c, b]), np.stack([b, c, d])]))


def apart(*meshes):
    """Meshes as one, not connected; the names of the k-th begin with k."""
    first = np.cumsum([0, *(mesh.p.shape[1] for mesh in meshes)])
    t = np.hstack([mesh.t + n for mesh, n in zip(meshes, first, strict=False)])
    whole = MeshTri(np.hstack([mesh.p for mesh in meshes]), t)
    lines = {}
    for k, mesh in enumerate(meshes):
        for name, rows in (mesh.boundaries or {}).items():
            ends = mesh.facets[:, rows] + first[k]
            code = whole.p.shape[1] * ends.min(axis=0) + ends.max(axis=0)
            lines[f"{k} {name}"] = np.flatnonzero(np.isin(whole.p.shape[1] * whole.facets[0] + whole.facets[1], code))
    of = np.repeat(np.arange(len(meshes)), [mesh.t.shape[1] for mesh in meshes])
    return whole.with_boundaries(lines).with_subdomains({str(k): np.flatnonzero(of == k) for k in range(len(meshes))})


def closed(nodes):
    """Nodes in order, the first again at the end."""
    return np.append(nodes, nodes[0])


def with_lines(mesh, lines):
    """The mesh with named boundaries: the facets between neighbours in lists of nodes."""
    names = {}
    for name, nodes in lines.items():
        pairs = np.sort([nodes[:-1], nodes[1:]], axis=0)
        code = mesh.p.shape[1] * pairs[0] + pairs[1]
        names[name] = np.flatnonzero(np.isin(mesh.p.shape[1] * mesh.facets[0] + mesh.facets[1], code))
    return mesh.with_boundaries(names)


def l_shape(n):
    """(-1, 1)^2 without its quadrant x > 0 > y, in n x n squares per unit."""
    mesh = square(2 * n, -1.0, 1.0)
    x, y = centres(mesh)
    return kept(mesh, (x < 0) | (y > 0))


def holed(n):
    """The unit square without its middle third; n a multiple of 3."""
    mesh = square(n)
    x, y = centres(mesh)
    return kept(mesh, (np.abs(x - 0.5) > 1 / 6) | (np.abs(y - 0.5) > 1 / 6))


def comb(n):
    """Three teeth on a back: deep concave outlines; n a multiple of 5."""
    mesh = square(n)
    x, y = centres(mesh)
    return kept(mesh, (y < 0.2) | (np.floor(5 * x) % 2 == 0))


def slit(n, tip=0.6):
    """The unit square cut along y = 1/2 from x = 0 to the tip: nodes are there twice; n even."""
    mesh = square(n)
    x, y = mesh.p
    doubled = np.flatnonzero((np.abs(y - 0.5) < 1e-9) & (x < tip - 1e-9))
    p = np.hstack([mesh.p, mesh.p[:, doubled]])
    twin = np.arange(mesh.p.shape[1])
    twin[doubled] = mesh.p.shape[1] + np.arange(len(doubled))
    above = centres(mesh)[1] > 0.5
    return MeshTri(p, np.where(above, twin[mesh.t], mesh.t))


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


def inset(n):
    """The unit square with a square "core" in its middle and "air" around it; n a multiple of 4."""
    core = lambda x: (np.abs(x[0] - 0.5) < 0.25) & (np.abs(x[1] - 0.5) < 0.25)  # noqa: E731
    return square(n).with_subdomains({"core": core, "air": lambda x: ~core(x)})


def junction(n):
    """Three subdomains that meet in a T at (1/2, 1/2); n even."""
    return square(n).with_subdomains(
        {
            "left": lambda x: (x[0] < 0.5) & (x[1] > 0.5),
            "right": lambda x: (x[0] > 0.5) & (x[1] > 0.5),
            "bottom": lambda x: x[1] < 0.5,
        }
    )


def named(n):
    """Every kind of name on one mesh: overlapping, missing and empty ones, sides, inner lines and loose ends."""
    mesh = square(n)
    mesh = mesh.with_subdomains(
        {
            "west": lambda x: x[0] < 0.5,
            "south": lambda x: x[1] < 0.25,
            "all": lambda x: x[0] < 2,
            "nothing": np.array([], dtype=np.int64),
        }
    )
    across = mesh.facets_satisfying(lambda x: (np.abs(x[1] - 0.75) < 1e-9) & (x[0] > 0.25) & (x[0] < 0.75))
    interface = mesh.facets_satisfying(lambda x: np.abs(x[0] - 0.5) < 1e-9)
    west = np.zeros(mesh.t.shape[1], dtype=bool)
    west[mesh.subdomains["west"]] = True
    return mesh.with_boundaries(
        {
            "floor": lambda x: x[1] == 0.0,
            "corner": lambda x: (x[0] == 0.0) | (x[1] == 0.0),
            "half": mesh.facets_satisfying(lambda x: (x[1] == 1.0) & (x[0] < 0.5)),
            "crack": across,
            "seam": OrientedBoundary(interface, (~west[mesh.f2t[0, interface]]).astype(np.int64)),
            "nowhere": np.array([], dtype=np.int64),
        }
    )


def perturbed(mesh, seed=0, rounds=3, reach=1.5, worst=0.02):
    """The same mesh with its inner nodes thrown about: valid, far from Delaunay, with slivers."""
    rng = np.random.default_rng(seed)
    p, t = mesh.p.copy(), mesh.t
    inner = np.setdiff1d(np.arange(p.shape[1]), np.concatenate([mesh.boundary_nodes(), outline_nodes(mesh)]))
    around = [np.flatnonzero((t == v).any(axis=0)) for v in range(p.shape[1])]
    sign = np.sign(doubled_areas(p, t))
    size = np.sqrt(np.abs(doubled_areas(p, t)).mean())
    for v in rng.permutation(np.repeat(inner, rounds)):
        before = p[:, v].copy()
        p[:, v] += rng.uniform(-reach, reach, 2) * size
        star = t[:, around[v]]
        if np.any(sign[around[v]] * doubled_areas(p, star) < worst * size**2):
            p[:, v] = before
    return MeshTri(p, t, mesh.boundaries, mesh.subdomains)


def outline_nodes(mesh):
    """Nodes on interfaces between subdomains and on named facets."""
    facets = [np.asarray(rows) for rows in (mesh.boundaries or {}).values()]
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    for rows in (mesh.subdomains or {}).values():
        member = np.zeros(mesh.t.shape[1], dtype=bool)
        member[rows] = True
        facets.append(inner[member[mesh.f2t[0, inner]] != member[mesh.f2t[1, inner]]])
    return np.unique(mesh.facets[:, np.concatenate(facets).astype(np.int64)]) if facets else np.array([], dtype=int)


def centres(mesh):
    """Barycentres of the elements, (2, nelements)."""
    return mesh.p[:, mesh.t].mean(axis=1)


def kept(mesh, mask):
    """The mesh of these elements only."""
    return mesh.remove_elements(np.flatnonzero(~mask))


def doubled_areas(p, t):
    """Twice the signed areas."""
    x, y = p[:, t]
    return (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])


def areas_of(triangulation):
    """Signed areas of the elements of a `Triangulation`."""
    return 0.5 * doubled_areas(triangulation.position.T, triangulation.elements.node.T)


def area_of(mesh, elements=slice(None)):
    """Total area of some elements."""
    return 0.5 * np.abs(doubled_areas(mesh.p, mesh.t[:, elements])).sum()


def length_of(mesh, facets):
    """Total length of some facets."""
    ends = mesh.p[:, mesh.facets[:, np.asarray(facets)]]
    return np.hypot(*(ends[:, 1] - ends[:, 0])).sum()


def peak(mesh, x, y, contrast=1e3, width=0.1):
    """A density per element with one peak, `contrast` times as high as the rest."""
    at = centres(mesh)
    return 1.0 + contrast * np.exp(-((at[0] - x) ** 2 + (at[1] - y) ** 2) / width**2)


def peak_at(x, y):
    """A density with a steep peak."""
    return lambda points: 1.0 / (0.03 + np.hypot(points[0] - x, points[1] - y)) ** 2


SHAPES = {
    "square": square(8),
    "bad": perturbed(square(8), 1),
    "delaunay": generic_square(9),
    "comb": comb(10),
    "hole": holed(9),
    "l": l_shape(4),
    "slit": slit(8),
    "inset": perturbed(inset(8), 2),
    "junction": junction(8),
    "named": named(8),
    "arcs": ring(24, 4),
}


def on_rim(mesh):
    """A mask of the nodes on the boundary."""
    return np.isin(np.arange(mesh.nvertices), mesh.boundary_nodes())
