"""Circles that radial interfaces cut into pieces of one to three facets, and polygons that are cut alike."""

import numpy as np
import pytest
from helpers.examples import examples
from helpers.meshes import circle, shells
from hypothesis import given
from hypothesis import strategies as st
from test_arcs import circles, outline_of

import kohonen_adapt as ka
from kohonen_adapt.kernels.triangle.arrays import HELD, ROUND

RADII = 0.5, 1.0, 2.0, 3.0


def at(angle):
    return np.stack([np.cos(angle), np.sin(angle)])


def segmented(around, corners, cut=(1,), rim=None):
    """Rings with interfaces at RADII[1:3] times a closed curve (2, n), and those of `cut` cut at the nodes `corners`.

    Rings and their sectors have regions of their own, "b3" the fourth sector of the middle ring.
    """
    n, layers = around.shape[1], 2
    mesh = shells([*(radius * around for radius in RADII[:3]), RADII[3] * (around if rim is None else rim)], layers)
    row, column = mesh.t // n, mesh.t % n
    ring = row.min(axis=0) // layers
    first = np.where(column.max(axis=0) - column.min(axis=0) > 1, n - 1, column.min(axis=0))
    sector = np.searchsorted(corners, first, side="right") - 1
    sector[sector < 0] = len(corners) - 1
    names = np.array([f"{'abc'[r]}{s if r in cut else ''}" for r, s in zip(ring, sector, strict=True)])
    return mesh.with_subdomains({str(name): np.flatnonzero(names == name) for name in np.unique(names)})


def angle_on(mesh, radius, **options):
    """The angle of all arcs of a radius about the origin, and the numbers of nodes of the mesh that are held there."""
    outline = outline_of(mesh, **options)
    chains = outline.constraints.chains
    left = np.stack([-chains.direction[:, 1], chains.direction[:, 0]])
    with np.errstate(divide="ignore", invalid="ignore"):
        centre = chains.origin.T + left / chains.curvature
    right = (chains.shape == ROUND) & (np.hypot(*centre) < 1e-3 * radius)
    right[right] = np.abs(np.abs(chains.curvature[right]) * radius - 1) < 1e-3
    held = (outline.constraints.kind == HELD) & (np.abs(np.hypot(*mesh.p) - radius) < 1e-3 * radius)
    return np.sum(chains.length[right]) / radius, np.flatnonzero(held)


def cut_ring(facets, sectors=16, cut=(1,)):
    return segmented(circle(facets * sectors, 0.1), facets * np.arange(sectors), cut)


@st.composite
def sectors(draw):
    """Numbers of facets of sectors, and angles of the nodes, with less than 35 degrees at every node."""
    counts = draw(st.lists(st.integers(1, 3), min_size=6, max_size=20))
    total = sum(counts)
    steps = np.array(draw(st.lists(st.floats(1.0, 1.4), min_size=total, max_size=total)))
    return counts, draw(st.floats(0, 6)) + 2 * np.pi * np.append(0, np.cumsum(steps))[:-1] / steps.sum()


@examples(30)
@given(sectors(), st.floats(-1e-4, 1e-4), st.sampled_from([(1,), (0, 1), (1, 2), (0, 1, 2)]))
def test_uneven_circles_are_round_and_nodes_within_a_thousandth_count(drawn, noise, cut):
    counts, angle = drawn
    gap = np.diff(np.append(angle, angle[0] + 2 * np.pi))
    sharp = np.degrees(0.5 * (gap + np.roll(gap, 1)).max()) >= 34.9
    off = 1 + noise * np.cos(7 * np.arange(len(angle)))
    mesh = segmented(off * at(angle), np.cumsum([0, *counts[:-1]]), cut)
    for radius in RADII[1:3]:
        found, held = angle_on(mesh, radius)
        assert sharp or (found == pytest.approx(2 * np.pi, rel=1e-3) and len(held) == len(counts))


def polygon(sides, cuts, begin=0.0):
    """The corners of a regular polygon, its sides cut into parts."""
    corner = circle(sides, begin)[:, :, None]
    share = np.arange(cuts) / cuts
    return (corner * (1 - share) + np.roll(corner, -1, axis=1) * share).reshape(2, -1)


POLYGONS = [(3, 8), (4, 1), (4, 4), (4, 6), (5, 1), (5, 3), (6, 1), (6, 2), (6, 3), (8, 2), (8, 3), (10, 2), (20, 3)]


@pytest.mark.parametrize(("sides", "cuts"), POLYGONS)
@pytest.mark.parametrize("at", ["corners", "all nodes", "one node"])
def test_polygons_stay_polygons_wherever_radial_interfaces_end(sides, cuts, at):
    """In a round rim about the same centre."""
    count = sides * cuts
    ends = {"corners": np.arange(0, count, cuts), "all nodes": np.arange(count), "one node": np.array([0])}[at]
    found = circles(segmented(polygon(sides, cuts), ends, rim=circle(count)))
    assert np.all(found[:, 2] == pytest.approx(3.0)) and len(found) == (count > 10)


def octagon():
    return segmented(circle(8), np.arange(8), rim=circle(8))


def test_coarser_ones_are_named_with_the_remedy(caplog):
    mesh = octagon()
    line = np.all(np.abs(np.hypot(*mesh.p[:, mesh.facets]) - 1.0) < 1e-9, axis=0)
    mesh = mesh.with_boundaries({"bore": np.flatnonzero(line)})
    ka.relocate(mesh, np.ones(mesh.t.shape[1]))
    said = [message for message in caplog.messages if "8 nodes on a circle of radius" in message]
    assert len(said) == 2
    assert "boundary 'bore' has 8 nodes on a circle of radius 1 about (0, 0) and turns by up to 45 degrees" in said[0]
    assert 'adapt with curves={"bore": ka.Arc((0, 0), 1)}, in a case adapt.curves.bore = ' in said[0]
    caplog.clear()
    given = {"bore": ka.Arc((0.0, 0.0), 1.0)}
    assert angle_on(mesh, 1.0, curves=given)[0] == pytest.approx(2 * np.pi)
    ka.relocate(mesh, np.ones(mesh.t.shape[1]), curves=given)
    assert not any("boundary 'bore' has" in message for message in caplog.messages)


@pytest.mark.parametrize("mesh", [cut_ring(1), segmented(polygon(6, 2), np.arange(0, 12, 2), rim=circle(12))])
def test_nothing_is_said_of_round_ones_and_of_hexagons(mesh, caplog):
    ka.relocate(mesh, np.ones(mesh.t.shape[1]))
    assert not any("nodes on a circle of radius" in message for message in caplog.messages)
