"""Layers of elements across thin subdomains.

A subdomain has k layers if every path along its edges from one side to the other has at least k edges. Levels of nodes
certify this: 0 on one side, k on the other, and a difference of at most 1 along every edge. Nodes keep their levels; a
change that would make an edge with a larger difference is refused.
"""

from collections import deque
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, IntsPair, Mask
from kohonen_adapt.geometry.plane.gap_sides import facing_sides
from kohonen_adapt.geometry.rules import checked_layers
from kohonen_adapt.kernels.triangle.arrays import Constraints, Elements
from kohonen_adapt.mesh.names import connected_components_of
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["Band", "bands_of", "bands_with", "check_layer_count", "parts_of", "set_levels", "steps_from"]


class Band(NamedTuple):
    name: str  # name of the subdomain
    number: int  # requested number of layers
    inside: Mask  # (r,) regions of its connected part
    pairs: Ints  # (k, 2) nodes of all edges of its connected part
    sides: IntsPair  # nodes on each side


def set_levels(triangulation: Triangulation, constraints: Constraints, layers: Mapping[str, int] | None) -> None:
    found = list(bands_with(triangulation, constraints, checked_layers(triangulation.mesh, layers)))
    for band in found:
        check_layer_count(triangulation.position, band)
        triangulation.elements.layered[band.inside] = True
    if found:
        triangulation.elements.level[:] = levels_of(found, triangulation.nnodes)


def parts_of(elements: Elements, regions: Ints) -> Iterator[Mask]:
    inside = np.zeros(len(elements.layered), bool)
    inside[regions] = True
    e, k = np.nonzero(elements.neighbour >= 0)
    pairs = elements.region[np.stack([e, elements.neighbour[e, k]], axis=1)]
    label = connected_components_of(len(inside), pairs[inside[pairs].all(axis=1)])
    for part in np.unique(label[inside]):
        yield inside & (label == part)


def bands_with(triangulation: Triangulation, constraints: Constraints, wanted: Mapping[str, int]) -> Iterator[Band]:
    for name, number in wanted.items():
        rows = np.asarray(triangulation.mesh.subdomains[name], np.int64)
        if not len(rows):
            raise ValueError(f"subdomain {name!r} has no elements, so it can have no layers; leave it out.")
        for inside in parts_of(triangulation.elements, triangulation.region_of_input[rows]):
            yield from bands_of(triangulation, constraints, name, number, inside)


def bands_of(
    triangulation: Triangulation, constraints: Constraints, name: str, number: int, inside: Mask
) -> list[Band]:
    sides = list(facing_sides(triangulation, constraints, inside))
    if not sides:
        raise ValueError(
            f"subdomain {name!r} must be thin to keep layers; it has no two sides that face each other. Leave it out."
        )
    node = triangulation.elements.node[inside[triangulation.elements.region]]
    pairs = node[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    return [Band(name, number, inside, pairs, both) for both in sides]


def check_layer_count(position: Floats, band: Band) -> None:
    steps = steps_from(band, 0, len(position))
    least = band.sides[1][np.argmin(steps[band.sides[1]])]
    if steps[least] < band.number:
        x, y = position[least]
        plural = "" if steps[least] == 1 else "s"
        raise ValueError(
            f"subdomain {band.name!r} has {steps[least]} layer{plural} of elements between its sides near "
            f"({x:.6g}, {y:.6g}); layers asks for {band.number}: topology='recycle' and target_nodes make "
            "the others, up to 8; else refine it there first."
        )


def steps_from(band: Band, side: int, count: int) -> Ints:
    # edges between every node and a side, at most the number of layers
    steps = np.full(count, min(band.number, count))
    steps[band.sides[side]] = 0
    lower_to_steps(band.pairs, steps)
    return steps


def lower_to_steps(edges: Ints, value: Ints) -> None:
    """Lower values (n,) in place until they differ by at most 1 along edges."""
    a, b = edges.T
    while np.any(np.abs(value[a] - value[b]) > 1):
        np.minimum.at(value, a, value[b] + 1)
        np.minimum.at(value, b, value[a] + 1)


def levels_of(bands: list[Band], count: int) -> Ints:
    level, on_side = levels_of_sides(bands, count)
    pairs = np.concatenate([band.pairs for band in bands])
    top = int(np.max(np.abs(level)))
    most, least, middle = np.where(on_side, level, top), np.where(on_side, -level, top), np.full(count, top)
    for band in bands:
        middle[np.concatenate([*band.sides, band.pairs.ravel()])] = (
            level[band.sides[0][0]] + level[band.sides[1][0]]
        ) // 2
    for value in (most, least, middle):
        lower_to_steps(pairs, value)
    if not np.array_equal(most[on_side], level[on_side]):
        raise contradiction(bands)
    return np.where(np.bincount(pairs.ravel(), minlength=count) > 0, np.minimum(most, np.maximum(-least, middle)), 0)


def levels_of_sides(bands: list[Band], count: int) -> tuple[Ints, Mask]:
    sides = [side for band in bands for side in band.sides]
    number = np.repeat(np.arange(len(sides)), [len(side) for side in sides])
    pairs = np.stack([number, len(sides) + np.concatenate(sides)], axis=1)
    label = connected_components_of(len(sides) + count, pairs)
    neighbours: dict[int, list[tuple[int, int]]] = {}
    for i, band in enumerate(bands):
        a, b = label[2 * i], label[2 * i + 1]
        neighbours.setdefault(a, []).append((b, band.number))
        neighbours.setdefault(b, []).append((a, band.number))
    found: dict[int, int] = {}
    for start in neighbours:
        found.setdefault(start, 0)
        waiting = deque([start])
        while waiting:
            a = waiting.popleft()
            for b, layers in neighbours[a]:
                if b not in found:
                    found[b] = found[a] + (layers if found[a] <= 0 else -layers)
                    waiting.append(b)
    if any(abs(found[label[2 * i]] - found[label[2 * i + 1]]) != band.number for i, band in enumerate(bands)):
        raise contradiction(bands)
    level, on_side = np.zeros(count, np.int64), np.zeros(count, bool)
    for i, side in enumerate(sides):
        level[side] = found[label[i]]
        on_side[side] = True
    return level, on_side


def contradiction(bands: list[Band]) -> ValueError:
    names = ", ".join(sorted({repr(band.name) for band in bands}))
    return ValueError(f"subdomains with layers touch so that not all can have theirs ({names}); ask for fewer of them.")
