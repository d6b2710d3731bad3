"""What a mesh is, in words: size, groups, coverage, quality, and what its outlines are taken for."""

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.triangle.chains import FREE, HELD, JUNCTION, ROUND, SLIDING, STRAIGHT
from kohonen_adapt.mesh.measures import area, quality
from kohonen_adapt.som.kohonen_map import KohonenMap

__all__ = ["counted", "described", "memberships", "outlines_described"]

LISTED = 6  # radii; of more than that the least and the greatest are told


def described(mesh: MeshTri) -> list[str]:
    """Lines about the size, the groups, the coverage and the quality of a mesh."""
    width, height = np.ptp(mesh.p, axis=1)
    return [
        f"size: {width:.4g} x {height:.4g} m, {mesh.p.shape[1]} nodes, {mesh.t.shape[1]} triangles",
        *_groups(mesh),
        _coverage(mesh),
        *_quality(mesh),
    ]


def memberships(mesh: MeshTri) -> NDArray[np.int64]:
    """In how many subdomains every element is, (nelements,)."""
    count = np.zeros(mesh.t.shape[1], dtype=np.int64)
    for rows in _named(mesh.subdomains).values():
        count[rows] += 1
    return count


def outlines_described(som: KohonenMap) -> list[str]:
    """Lines about the chains of a map by kind, and about what its nodes may do."""
    constraints = som.outline.constraints
    chains, kind = constraints.chains, constraints.kind
    round_ = chains.shape == ROUND
    held, (one, other) = kind == HELD, constraints.chain.T
    jumps = held & ((other >= 0) | (one == JUNCTION))
    return [
        f"outlines: {counted(len(chains.shape), 'chain')}, {np.sum(chains.shape == STRAIGHT)} straight, "
        f"{np.sum(round_)} on arcs{_radii(1.0 / np.abs(chains.curvature[round_]))}, "
        f"{np.sum(chains.closed)} closed",
        f"nodes: {np.sum(kind == FREE)} free, {np.sum(kind == SLIDING)} slide on outlines, "
        f"{np.sum(jumps)} in corners that others may take, {np.sum(held & ~jumps)} held for good",
    ]


def _named(sets: dict[str, Ints] | None) -> dict[str, Ints]:
    return {name: np.asarray(rows) for name, rows in sorted((sets or {}).items()) if not name.startswith("gmsh:")}


def _groups(mesh: MeshTri) -> list[str]:
    areas = area(mesh)
    return [
        *(
            f"subdomain '{name}': {counted(len(rows), 'triangle')}, {areas[rows].sum():.4g} m^2"
            for name, rows in _named(mesh.subdomains).items()
        ),
        *(f"boundary '{name}': {counted(len(rows), 'facet')}" for name, rows in _named(mesh.boundaries).items()),
    ]


def _coverage(mesh: MeshTri) -> str:
    count = memberships(mesh)
    return f"coverage: {np.sum(count == 1)} triangles in one subdomain, {np.sum(count == 0)} in none, " + (
        f"{np.sum(count > 1)} in two or more"
    )


def _quality(mesh: MeshTri) -> list[str]:
    value = quality(mesh)
    worst = int(np.argmin(value))
    x, y = mesh.p[:, mesh.t[:, worst]].mean(axis=1)
    return [
        f"quality: worst {value[worst]:.3g} (triangle {worst} near ({x:.6g}, {y:.6g}) m), mean {value.mean():.3g}",
        f"angles: from {_smallest_angle(mesh):.3g} degrees on",
    ]


def _smallest_angle(mesh: MeshTri) -> float:
    corners = mesh.p[:, mesh.t]
    one, other = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    across, along = one[0] * other[1] - one[1] * other[0], np.sum(one * other, axis=0)
    return float(np.degrees(np.arctan2(np.abs(across), along).min()))


def _radii(radii: Floats) -> str:
    texts = list(dict.fromkeys(f"{radius:.4g}" for radius in np.sort(radii)))
    if not texts:
        return ""
    said = ", ".join(texts) if len(texts) <= LISTED else f"{texts[0]} to {texts[-1]}"
    return f" (radius {said} m)"


def counted(count: int, what: str) -> str:
    """A number of things: 1 node, 2 nodes."""
    return f"{count} {what}{'s' * (count != 1)}"
