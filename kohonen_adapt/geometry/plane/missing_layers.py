"""Creation of missing layers of elements across thin subdomains."""

import logging
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Ints
from kohonen_adapt.checks import listed
from kohonen_adapt.geometry.movable import unchanged
from kohonen_adapt.geometry.plane.layers import Band, bands_of, lower_to_steps, parts_of
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.surgery import Surgery
from kohonen_adapt.geometry.rules import Rules, checked_layers
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.triangle.surgery import find_edge, midpoint, split

logger = logging.getLogger("kohonen_adapt")

__all__ = ["with_layers"]

MOST = 8  # maximum number of layers that is made; more must be in the input mesh


def with_layers(mesh: MeshTri, rules: Rules, grows: bool = False) -> MeshTri:
    # Every edge in the middle of a path across with too few edges is halved, until all paths are long enough. New
    # nodes follow the nodes of the input in number.
    if not rules.layers or not (grows or rules.topology == "recycle"):
        return mesh
    movable = MovableMesh.of(mesh, replace(rules, layers=None, periodic=()))
    wanted = {name: number for name, number in checked_layers(mesh, rules.layers).items() if number <= MOST}
    while len(edges := edges_to_split(movable, wanted)):
        split_edges(movable, edges)
    made = movable.nnodes - mesh.p.shape[1]
    if made:
        logger.info("made layers of elements in %s by %d new nodes", listed(rules.layers), made)
    return movable.mesh() if made else mesh


def edges_to_split(movable: MovableMesh, wanted: dict[str, int]) -> Ints:
    found = [np.empty((0, 2), dtype=np.int64)]
    for band in bands(movable, wanted):
        from_one, from_other = (np.full(movable.nnodes, min(band.number, movable.nnodes)) for _ in band.sides)
        for steps, side in ((from_one, band.sides[0]), (from_other, band.sides[1])):
            steps[side] = 0
            lower_to_steps(band.pairs, steps)
        a, b = np.concatenate([band.pairs, band.pairs[:, ::-1]]).T
        across = from_one[a] + 1 + from_other[b]
        found.append(np.stack([a, b], axis=1)[(across < band.number) & (from_one[a] == across // 2)])
    return np.unique(np.sort(np.concatenate(found), axis=1), axis=0)


def bands(movable: MovableMesh, wanted: dict[str, int]) -> Iterator[Band]:
    triangulation = movable.triangulation
    for name, number in wanted.items():
        rows = np.asarray(triangulation.mesh.subdomains[name], dtype=np.int64)
        for inside in parts_of(triangulation.elements, triangulation.region_of_input[rows]):
            yield from bands_of(triangulation, movable.constraints, name, number, inside)


def split_edges(movable: MovableMesh, edges: Ints) -> None:
    n = movable.nnodes
    surgery = Surgery.on(movable, np.ones(n), n + len(edges), unchanged(movable.triangulation))
    # interpreted, because few edges are halved, once for a mesh: compiling would take longer
    find, middle, halve = (interpreted(loop) for loop in (find_edge, midpoint, split))
    for a, b in edges.tolist():
        e, k = find(surgery.mesh, a, b)
        halve(surgery.mesh, e, k, *middle(surgery.mesh, np.int64(surgery.mesh.elements.chain[e, k]), a, b))
    surgery.write_back(movable)
