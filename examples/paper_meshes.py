"""Start meshes made by mappings, training points, runs and measures behind the figures of Lowther and Mai."""

from dataclasses import dataclass, replace
from functools import cache
from time import process_time

import numpy as np
from scipy.spatial import cKDTree
from skfem import MeshTri

import kohonen_adapt as ka

QUADRILATERAL = np.array([[0.0, 4.0, 3.4, 0.5], [0.0, 0.0, 2.6, 2.2]])  # corners, counter-clockwise


def peak(centre, height, width):
    """A density: 1 far from `centre`, and `height` more there."""
    return lambda x: 1 + height * np.exp(-0.5 * ((x[0] - centre[0]) ** 2 + (x[1] - centre[1]) ** 2) / width**2)


PEAK = (2.5, 0.3)
UNGUARDED, ONLY_OVERLAPS = None, 0.0  # what the paper forbids an update: nothing, or to overturn an element
DENSITY = peak(PEAK, height=25, width=0.5)  # of training points, in figures 2 to 7
RATE = (0.3, 0.02)  # learning rate of the first and of the last epoch
ENOUGH = 0.55  # of the start mesh's error: the stopping criterion of figure 5


@dataclass(frozen=True)
class Effort:
    """How large the meshes are and how long they are trained."""

    columns: int  # of the start mesh of figures 2, 5 and 7; rows are two thirds as many
    epochs: tuple[int, int, int]  # at R = 2, 1, 0, at most
    l_rows: int  # squares across a leg of figure 8
    quarter: int  # a quarter of the squares per side of figure 9
    study_columns: int
    study_epochs: tuple[int, ...]  # at R = 2 and at R = 1
    study_seeds: int
    points_per_neuron: tuple[float, ...]
    rates: tuple[float, ...]
    neurons: tuple[int, ...]  # for the cost


FULL = Effort(
    columns=30,
    epochs=(10, 60, 60),
    l_rows=14,
    quarter=6,
    study_columns=24,
    study_epochs=(0, 1, 2, 5, 10, 20, 40, 80),
    study_seeds=3,
    points_per_neuron=(0.25, 0.5, 1, 2, 4, 8, 16),
    rates=(0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0),
    neurons=(1_000, 3_162, 10_000, 31_623, 100_000),
)
QUICK = Effort(
    columns=18,
    epochs=(10, 20, 40),
    l_rows=10,
    quarter=4,
    study_columns=12,
    study_epochs=(0, 2, 8),
    study_seeds=2,
    points_per_neuron=(0.5, 2, 8),
    rates=(0.05, 0.3, 1.0),
    neurons=(400, 1_600, 6_400),
)


def quadrilateral(columns, rows):
    """A tensor mesh of the unit square, its coordinates mapped onto the quadrilateral."""
    square = MeshTri.init_tensor(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    return MeshTri(onto_quadrilateral(square.p), square.t)


def onto_quadrilateral(p):
    """The bilinear map of the unit square onto the quadrilateral: straight lines of the grid stay straight."""
    s, t = p
    return QUADRILATERAL @ np.array([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t])


def l_shape(n):
    """A strip of 2n by n squares, bent into an L at a mitre from its outer to its re-entrant corner."""
    strip = MeshTri.init_tensor(np.linspace(0, 2, 2 * n + 1), np.linspace(0, 1, n + 1))
    return MeshTri(onto_l_shape(strip.p), strip.t)


def onto_l_shape(p):
    """s runs down the upright leg and then along the lower one, t from the outer outline to the inner."""
    s, t = p
    outer = np.array([np.maximum(0, 2 * s - 2), np.maximum(0, 2 - 2 * s)])
    inner = np.array([np.maximum(1, s), np.maximum(1, 2 - s)])
    return (1 - t) * outer + t * inner


def two_regions(n):
    """A quadrilateral "inner" within an "outer" one, in 4n by 4n cells; their interface lies on lines of the grid."""
    ticks = np.linspace(0, 1, 4 * n + 1)
    square = MeshTri.init_tensor(ticks, ticks)
    s, t = square.p[:, square.t].mean(axis=1)
    inside = np.maximum(np.abs(s - 0.5), np.abs(t - 0.5)) < 0.25
    mesh = MeshTri(onto_quadrilateral(square.p), square.t)
    return mesh.with_subdomains({"inner": np.flatnonzero(inside), "outer": np.flatnonzero(~inside)})


def training_points(mesh, density, number, rng):
    """Random points (2, number) of the mesh, as dense as the density says: candidates are kept by its value."""
    low, high = mesh.p.min(axis=1)[:, None], mesh.p.max(axis=1)[:, None]
    largest, kept = density(mesh.p).max(), np.empty((2, 0))
    while kept.shape[1] < number:
        x = low + (high - low) * rng.random((2, 4 * number))
        x = x[:, rng.random(4 * number) * largest < density(x)]
        kept = np.hstack([kept, x[:, ka.find_elements(mesh, x) >= 0]])
    return kept[:, :number]


def mean_distance(mesh, points):
    """Mean distance of points to the nearest node: equation 2 over the number of points, in convex regions."""
    return float(cKDTree(mesh.p.T).query(points.T)[0].mean())


def signed_area(mesh):
    """Area of every element, negative where its nodes run clockwise."""
    (ax, ay), (bx, by), (cx, cy) = mesh.p[:, mesh.t].swapaxes(0, 1)
    return 0.5 * ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))


def area(mesh):
    """Area of every element."""
    return np.abs(signed_area(mesh))


def overturned(mesh, start):
    """Mask of the elements whose orientation is not that of the start mesh, which has the same topology."""
    return np.sign(signed_area(mesh)) != np.sign(signed_area(start))


def node_density(mesh):
    """Nodes per area at every node: one over a third of the area around it."""
    share = np.repeat(area(mesh)[None] / 3, 3, axis=0)
    return 1 / np.bincount(mesh.t.ravel(), weights=share.ravel())


def on_segment(mesh, a, b):
    """The nodes on a straight line from a to b, both ends included."""
    along, to = b - a, mesh.p - a[:, None]
    off, share = along[0] * to[1] - along[1] * to[0], along @ to / (along @ along)
    return np.flatnonzero((np.abs(off) < 1e-9) & (share > -1e-9) & (share < 1 + 1e-9))


def circle_inside(mesh, centre, through):
    """Whether a circle lies in the mesh, to 64 of its points."""
    angle = np.linspace(0, 2 * np.pi, 64)
    rim = np.hypot(*(through - centre)) * np.array([np.cos(angle), np.sin(angle)])
    return bool(np.all(ka.find_elements(mesh, centre[:, None] + rim) >= 0))


def nodes_on_sides(mesh):
    """Number of nodes on each side of the quadrilateral, both corners counted."""
    ends = zip(QUADRILATERAL.T, np.roll(QUADRILATERAL, -1, axis=1).T, strict=True)
    return [len(on_segment(mesh, a, b)) for a, b in ends]


def rings(mesh, winner, radius):
    """The nodes of every ring around a winner: none of ring k is nearer than k edges."""
    found, seen = [np.array([winner])], np.array([winner])
    for _ in range(radius):
        touched = mesh.t[:, np.isin(mesh.t, seen).any(axis=0)]
        found.append(np.setdiff1d(touched, seen))
        seen = np.union1d(touched, seen)
    return found


def node_at(mesh, x):
    """The node nearest to a point, and how far it is."""
    distance, node = cKDTree(mesh.p.T).query(x)
    return int(node), float(distance)


def nearest_nodes(mesh, points):
    """The node nearest to each point: its winner, in a convex region."""
    return cKDTree(mesh.p.T).query(points.T)[1]


def training_set(effort):
    """Start mesh and training points of figures 2 to 7."""
    start = quadrilateral(effort.columns, 2 * effort.columns // 3)
    return start, training_points(start, DENSITY, 2 * start.p.shape[1], np.random.default_rng(1))


@cache
def converged(effort):
    """Start mesh, training points, mesh after the paper's training, and the mean distance of every epoch."""
    start, points = training_set(effort)
    schedule = ka.Schedule.paper(effort.epochs, RATE)
    som = ka.KohonenMap(start, topology="fixed", min_quality=ONLY_OVERLAPS)
    errors = som.train(points, replace(schedule, tolerance=ENOUGH * mean_distance(start, points)))
    return start, points, som.mesh, errors


def unchecked(effort):
    """The same training epoch by epoch with no check: start mesh, end mesh, overturned elements after every epoch."""
    start, points = training_set(effort)
    som, counts = ka.KohonenMap(start, topology="fixed", min_quality=UNGUARDED), []
    for stage in ka.Schedule.paper(effort.epochs, RATE).stages:
        for rate in stage.rates():
            once = ka.Schedule((replace(stage, epochs=1, learning_rate=rate),), fresh=False)
            som.train(points, once, seed=len(counts))
            counts.append(int(overturned(som.mesh, start).sum()))
    return start, som.mesh, counts


def find_jump(mesh):
    """Train single points until one that is far from all nodes makes a corner change hands.

    Returns the mesh before, the mesh after, the point and the corner.
    """
    som = ka.KohonenMap(mesh, topology="fixed", min_quality=ONLY_OVERLAPS)
    once = ka.Schedule((ka.Stage(1, 1, 0.4, neighbourhood="flat"),), fresh=False)
    for point in training_points(mesh, DENSITY, 2000, np.random.default_rng(0)).T:
        before = som.mesh
        som.train(point[:, None], once)
        for corner in QUADRILATERAL.T:
            if node_at(som.mesh, corner)[0] != node_at(before, corner)[0] and node_at(before, point)[1] > 0.25:
                return before, som.mesh, point, corner
    raise RuntimeError("no corner changed hands.")


def neighbours(mesh):
    """Every node (rows) and the nodes around it, rows filled up with the node itself."""
    node, other = np.hstack([mesh.facets, mesh.facets[::-1]])
    order = np.argsort(node)
    node, other = node[order], other[order]
    count = np.bincount(node)
    around = np.tile(np.arange(len(count))[:, None], count.max() + 1)
    around[node, 1 + np.arange(len(node)) - (np.cumsum(count) - count)[node]] = other
    return around


def walks(mesh, points, starts):
    """The nodes that walks to points visit (columns): to the closest neighbour, and on until none is closer."""
    around, visited = neighbours(mesh), [starts]
    while True:
        near = around[visited[-1]]
        closest = np.hypot(*(mesh.p[:, near] - points[:, :, None])).argmin(axis=1)
        if not closest.any():
            return np.array(visited)
        visited.append(np.take_along_axis(near, closest[:, None], axis=1)[:, 0])


def mean_steps(mesh, points, starts):
    """Mean number of steps of walks to points."""
    return float(np.mean((np.diff(walks(mesh, points, starts), axis=0) != 0).sum(axis=0)))


@cache
def searched(effort):
    """A trained mesh, and the paths of searches for random points from random neurons: (point, path) of each.

    A path is a walk, and the winner after it where the check of the circle betters the walk's last neuron.
    """
    mesh, rng = converged(effort)[2], np.random.default_rng(3)
    points = training_points(mesh, lambda x: np.ones(x.shape[1]), 600, rng)
    visited = walks(mesh, points, rng.integers(0, mesh.p.shape[1], points.shape[1]))
    ways = np.vstack([visited, nearest_nodes(mesh, points)]).T
    return mesh, [(x, way[np.append(True, np.diff(way) != 0)]) for x, way in zip(points.T, ways, strict=True)]


def trained_ratios(mesh, effort, schedule, per_neuron=2.0):
    """e / e0 on the training set, and on a large set that was not shown, means over the seeds."""
    n, ratios = mesh.p.shape[1], []
    for seed in range(effort.study_seeds):
        rng = np.random.default_rng(seed)
        points = training_points(mesh, DENSITY, int(per_neuron * n), rng)
        others = training_points(mesh, DENSITY, 20 * n, rng)
        som = ka.KohonenMap(mesh, topology="fixed", min_quality=ONLY_OVERLAPS)
        som.train(points, schedule, seed=seed)
        ratios.append([mean_distance(som.mesh, x) / mean_distance(mesh, x) for x in (points, others)])
    return np.mean(ratios, axis=0).tolist()


def study_epochs(mesh, effort):
    """e / e0 after so many epochs at R = 2 (rows), then at R = 1 (columns), none at R = 0."""
    counts = effort.study_epochs
    return np.array(
        [[trained_ratios(mesh, effort, ka.Schedule.paper((two, one, 0), RATE))[0] for one in counts] for two in counts]
    )


def study_points(mesh, effort):
    """e / e0 over the number of training points per neuron: of the set itself, and of points not shown."""
    schedule = ka.Schedule.paper((3, 20, 10), RATE)
    rows = [trained_ratios(mesh, effort, schedule, per_neuron) for per_neuron in effort.points_per_neuron]
    return [list(column) for column in zip(*rows, strict=True)]


def study_rates(mesh, effort):
    """e / e0 over the first learning rate: of the training set, and of points not shown."""
    rows = [trained_ratios(mesh, effort, ka.Schedule.paper((3, 20, 10), (rate, RATE[1]))) for rate in effort.rates]
    return [list(column) for column in zip(*rows, strict=True)]


def density_near(mesh, x, radius):
    """Nodes per area within a circle, from their mean share of area."""
    near = np.hypot(*(mesh.p.T - x).T) < radius
    return float(1 / np.mean(1 / node_density(mesh)[near]))


def cost(count):
    """Steps and processor seconds of a map of about so many neurons; locating the points once is in the seconds."""
    rows = round(np.sqrt(count / 1.5))
    mesh, rng = quadrilateral(round(1.5 * rows), rows), np.random.default_rng(11)
    points = training_points(mesh, DENSITY, 2 * mesh.p.shape[1], rng)
    seconds, later = {}, []
    for radius in (2, 1, 0):
        som = ka.KohonenMap(mesh, topology="fixed", min_quality=ONLY_OVERLAPS)
        stage = ka.Stage(radius, 4, 0.1, neighbourhood="flat")
        begin = process_time()
        som.train(points, ka.Schedule((stage,), fresh=False))
        seconds[radius] = (process_time() - begin) / 4
        last_winners = nearest_nodes(som.mesh, points)
        som.train(points, ka.Schedule((replace(stage, epochs=1),), fresh=False))
        later.append(mean_steps(som.mesh, points, last_winners))
    return {
        "neurons": mesh.p.shape[1],
        "seconds": seconds,
        "random": mean_steps(som.mesh, points[:, :40], rng.integers(0, mesh.p.shape[1], 40)),
        "first": mean_steps(mesh, points, mesh.t[0, ka.find_elements(mesh, points)]),
        "later": float(np.mean(later)),
    }


def slope(n, values):
    """Exponent of the power of N that fits best."""
    return float(np.polyfit(np.log(n), np.log(values), 1)[0])
