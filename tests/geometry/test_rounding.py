"""A mesh refined once, with its arcs as they are and rounder."""

import numpy as np
import pytest
from helpers.meshes import square
from helpers.tensor_meshes import disk, equal_rings, sector

from kohonen_adapt.geometry.plane.arcs import refined_on_arcs
from kohonen_adapt.mesh.curved import with_midsides
from kohonen_adapt.mesh.measures import area

DISK = disk(equal_rings(8, 1.0), {"magnet": 4, "air": 8})


def size_of(mesh, name):
    return area(mesh)[mesh.subdomains[name]].sum()


def test_what_chords_cut_off_falls_to_a_quarter_inside_and_not_in_the_other_mesh():
    chords, arcs = refined_on_arcs(DISK)
    missing = [np.pi / 4 - size_of(mesh, "magnet") for mesh in (DISK, chords, arcs)]
    assert missing[1] == pytest.approx(missing[0])
    assert missing[2] == pytest.approx(missing[0] / 4, rel=0.01)


def test_what_parabolas_leave_of_arcs_falls_to_a_sixteenth():
    middles = DISK.p[:, DISK.facets].mean(axis=1)
    round_ones = np.isclose(*np.hypot(*DISK.p)[DISK.facets])
    radius = np.hypot(*DISK.p[:, DISK.facets[0]])
    bent = with_midsides(DISK, np.where(round_ones, radius / np.hypot(*middles), 1.0) * middles)
    chords, arcs = refined_on_arcs(bent)
    missing = [np.pi / 4 - size_of(mesh, "magnet") for mesh in (bent, chords, arcs)]
    assert missing[1] == pytest.approx(missing[0])
    assert missing[2] == pytest.approx(missing[0] / 16, rel=0.03)


def test_there_are_none_where_nothing_inside_is_round():
    assert refined_on_arcs(square(8)) is None
    assert refined_on_arcs(disk(equal_rings(8, 1.0), {"all": 8})) is None


def test_there_are_none_where_an_element_would_be_overturned():
    flat = sector([0.999, 1.0, 1.0001, 1.2], np.linspace(0.0, np.pi / 2, 8), {"thin": (1.0, 1.0001, 0, np.pi / 2)})
    assert refined_on_arcs(flat) is None
