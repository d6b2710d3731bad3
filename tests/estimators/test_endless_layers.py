"""Layers without end against P1 solutions on many layers."""

import numpy as np
import pytest
from helpers.linear_problems import assembled, solved
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.estimators.discrete_flux import discrete_flux
from kohonen_adapt.estimators.endless_layers import System, missing_square


def disk_of_sectors(angles, closed, sides=3):
    """Triangles around the origin, each of `angles` divided into `sides`, and a second ring of triangles."""
    turn = np.append(0.0, np.cumsum(np.repeat(np.asarray(angles) / sides, sides)))
    count = turn.size - closed
    ring = np.stack((np.cos(turn[:count]), np.sin(turn[:count])))
    p, inner = np.hstack((np.zeros((2, 1)), 0.2 * ring, ring)), np.arange(turn.size - 1)
    one, other = 1 + inner, 1 + (inner + 1) % count
    t = np.hstack(
        [
            np.stack(each)
            for each in ((0 * one, one, other), (one, one + count, other + count), (one, other + count, other))
        ]
    )
    return MeshTri(p, t), np.tile(inner // sides, 3)


def minimum(mesh, nu, fixed, values, source, flux):
    matrix, load = assembled(mesh, nu, np.full(nu.size, source), flux)
    u = solved(matrix, load, values, fixed)
    return u, 0.5 * u @ matrix @ u - load @ u


@pytest.mark.parametrize(
    ("angles", "nu", "closed", "sides"),
    [
        ([1.2, 1.9, 1.4, 2.0 * np.pi - 4.5], [1.0, 300.0, 1.0, 200.0], True, ()),
        ([1.0, 1.5, 0.8], [1.0, 0.01, 2.0], False, ()),
        ([1.0, 1.5, 0.8], [100.0, 1.0, 50.0], False, (0, 1)),
        ([1.5, 1.6], [0.02, 1.0], False, (0,)),
    ],
)
@pytest.mark.parametrize("loaded", [False, True])
def test_recovery_sees_what_forty_layers_lower(angles, nu, closed, sides, loaded):
    """The energy falls by half of the squared error, by layers without end a little more, up to finer sides."""
    mesh, sector = disk_of_sectors(angles, closed)
    nu = np.array(nu)[sector]
    source, flux = (0.3, np.outer([0.4, -0.2], nu > 1.0)) if loaded else (0.0, np.zeros((2, nu.size)))
    finer = ka.refined_at(mesh, [0], layers=40, factor=0.5)
    parent = np.empty(finer.nelements, dtype=int)
    parent[:] = ka.find_elements(mesh, finer.p[:, finer.t].mean(axis=1))
    found = []
    for each, rows in ((mesh, np.arange(nu.size)), (finer, parent)):
        angle, radius = np.mod(np.arctan2(each.p[1], each.p[0]), 2.0 * np.pi), np.hypot(*each.p)
        ends = [np.abs(angle - end) < 1e-9 for end in (0.0, sum(angles))]
        fixed = radius > 0.9
        for side in sides:
            fixed |= ends[side] | (radius == 0.0)
        values = np.where(radius > 0.9, np.sin(1.5 * angle) if not closed else np.cos(angle), 0.0)
        found.append(minimum(each, nu[rows], fixed, values, source, flux[:, rows]))
    (u, coarse), (_, fine) = found
    discrete = discrete_flux(mesh, u, nu, np.full(nu.size, source), flux)
    star = np.flatnonzero(np.any(mesh.t == 0, axis=0))
    squared = missing_square(System.of(discrete), 0, star)
    assert 1.0 <= squared / (2.0 * (coarse - fine)) <= 1.3
