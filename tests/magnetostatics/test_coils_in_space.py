"""Coils of rectangular section: their field against closed forms, filaments, Ampere's law and curl H = J."""

import numpy as np
import pytest

from kohonen_adapt.kernels.coils import add_arcs
from kohonen_adapt.magnetostatics import Coil
from kohonen_adapt.magnetostatics.coils.source import source_of

AXIS = (0.0, 0.0, 1.0)
CORNERS = 0.01 * np.array([[0, 3, 3, 2, 2, 0], [0, 0, 1, 1, 3, 3], [0] * 6])  # an L
COILS = {
    "circular": Coil.circular((0.0, 0.0, 0.01), AXIS, 0.02, (0.02, 0.04), 1000.0),
    "tilted": Coil.racetrack((0.01, 0.02, 0.0), (1.0, 1.0, 2.0), 0.06, 0.04, 0.012, (0.018, 0.03), 1000.0),
    "limb": Coil.straight_limb((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.03, 0.02), (0.01, 0.05), -500.0),
    "mitred": Coil(CORNERS, 0.004, 0.01, 1000.0),
    "rounded": Coil(CORNERS, 0.004, 0.01, 1000.0, 0.004),
}


def points_near(coil, count, seed=0):
    """Points in and around a winding, none within a hundredth of its width of a surface."""
    rng, middle = np.random.default_rng(seed), coil.path.mean(axis=1, keepdims=True)
    x = middle + rng.uniform(-0.04, 0.04, (3, 400 + 40 * count))
    step = 1e-2 * coil.width * np.concatenate((np.eye(3), -np.eye(3)))
    same = np.all([coil.contains(x + each[:, None]) == coil.contains(x) for each in step], axis=0)
    inside = np.flatnonzero(same & coil.contains(x))[: count // 2]
    return x[:, np.concatenate((inside, np.flatnonzero(same & ~coil.contains(x))[: count // 2]))]


@pytest.mark.parametrize("name", COILS)
def test_the_curl_is_the_current_density_and_there_is_no_divergence(name):
    coil, step = COILS[name], 1e-6
    x = points_near(coil, 400)
    slope = np.array(
        [
            (coil.field_strength(x + step * e[:, None]) - coil.field_strength(x - step * e[:, None])) / (2.0 * step)
            for e in np.eye(3)
        ]
    )
    curl = np.array([slope[1, 2] - slope[2, 1], slope[2, 0] - slope[0, 2], slope[0, 1] - slope[1, 0]])
    density = coil.current_density(x)
    scale = abs(coil.ampere_turns) / (coil.width * coil.height)
    size = np.linalg.norm(density, axis=0)
    np.testing.assert_allclose(size, np.where(coil.contains(x), scale, 0.0), rtol=1e-9)
    assert np.abs(curl - density).max() < 2e-3 * scale and np.median(np.abs(curl - density)) < 1e-6 * scale
    assert np.abs(np.trace(slope)).max() < 1e-4 * scale


@pytest.mark.parametrize("section", [(0.3, 0.4), (1.8, 0.05), (0.02, 1.0), (0.02, 0.02), (0.005, 0.005)])
def test_the_quadrature_of_arcs_is_as_good_as_said(section):
    """On and beside the surfaces of thick and of thin windings, against 200 points."""
    rng, (t, weight) = np.random.default_rng(0), np.polynomial.legendre.leggauss(200)
    t, weight = 0.5 * (1.0 + t), 0.5 * weight
    for coil in (
        Coil.circular((0.0, 0.0, 0.0), AXIS, 1.0, section, 1.0),
        Coil.racetrack((0.0, 0.0, 0.0), AXIS, 6.0, 4.0, 1.0, section, 1.0),
    ):
        _, arcs = source_of(coil.winding, coil.ampere_turns / (coil.width * coil.height))
        x = rng.uniform(-2.0, 2.0, (3, 300))
        for depth in (-0.5, -0.49, 0.0, 0.4999, 0.5, 0.51):
            for height in (-0.5, -0.499, 0.3, 0.5, 0.52):
                line = coil.winding.offset_path(depth * coil.width)[::5]
                line = line + 1e-4 * coil.width * (rng.normal(size=(2, line.size)).T @ [1.0, 1j])
                x = np.append(x, coil.winding.in_space(line, height * coil.height), axis=1)
        found, exact, points = np.zeros(x.T.shape), np.zeros(x.T.shape), np.ascontiguousarray(x.T)
        add_arcs(arcs, points, 0, len(points), found)
        clustered = (np.array([200], dtype=np.int32), np.zeros(1), t[None] ** 5, 5.0 * t[None] ** 4 * weight)
        fine = arcs._replace(**dict(zip(("npoints", "reach", "fraction", "weight"), clustered, strict=True)))
        add_arcs(fine, points, 0, len(points), exact)
        assert np.abs(found - exact).max() < 1e-5 * np.abs(coil.field_strength(x)).max()


SQUARE = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0], [0.0] * 4])
FORK = np.array([[0, 3, 3, 2, 2, 1, 1, 0], [0, 0, 3, 3, 1, 1, 3, 3], [0] * 8])
BAD = {
    r"; got shape \(4, 3\)\. Transpose it: the rows are x, y and z\.$": lambda: (SQUARE.T, 0.1, 0.1),
    r"^path must be three or more points of shape \(3, k\), .*; got shape \(3, 2\)": lambda: (SQUARE[:, :2], 0.1, 0.1),
    r"^path has the point \(1, 0, 0\) twice in succession": lambda: (SQUARE[:, [0, 1, 1, 2]], 0.1, 0.1),
    r"^path encloses no area; give the corners in succession": lambda: (SQUARE[:, [0, 2, 1, 3]], 0.1, 0.1),
    r"^path crosses itself on the side from": lambda: (np.array([[0, 1, 0.2, 0.5], [0, 0, 1, 1], [0] * 4]), 0.01, 0.1),
    r"^path turns back at": lambda: (np.array([[0, 2, 1, 1, 0], [0, 0, 0, 1, 1], [0] * 5]), 0.01, 0.1),
    r"^path must be plane, .* up to 0.0249 m off a plane\. Give": lambda: (
        SQUARE + np.diag([0.0, 0.0, 0.1]) @ np.eye(3, 4, 1),
        0.1,
        0.1,
    ),
    r"^width of a coil, in m, must be a positive number; got -0.1": lambda: (SQUARE, -0.1, 0.1),
    r"^height of a coil, in m, must be a positive number; got 0": lambda: (SQUARE, 0.1, 0),
    r"^a winding of width 1.1 m is wider than its bore at a side of 1 m": lambda: (SQUARE, 1.1, 0.1),
    r"^a winding of width 1.2 m is wider than its bore": lambda: (FORK, 1.2, 0.1),
    r"^ampere_turns of a coil must be a finite number in A; got nan": lambda: (SQUARE, 0.3, 0.1, np.nan),
    r"^the radius, 0.1 m, must be at least half the width of the winding, 0.15 m": lambda: (SQUARE, 0.3, 0.1, 1.0, 0.1),
    r"^corners with a radius of 0.6 m need 1.2 m of a side that has 1 m": lambda: (SQUARE, 0.3, 0.1, 1.0, 0.6),
}


@pytest.mark.parametrize("message", BAD)
def test_bad_paths_and_sections(message):
    arguments = BAD[message]()
    arguments = arguments if len(arguments) > 3 else (*arguments, 1.0)
    with pytest.raises(ValueError, match=message):
        Coil(*arguments)


def test_bad_shapes():
    with pytest.raises(ValueError, match=r"section of a coil must be two positive numbers, width and height in m; got"):
        Coil.circular((0.0, 0.0, 0.0), AXIS, 0.1, (0.1, -0.1), 1.0)
    with pytest.raises(ValueError, match=r"axis and along of a coil must be directions that differ"):
        Coil.racetrack((0.0, 0.0, 0.0), AXIS, 1.0, 0.5, 0.2, (0.1, 0.1), 1.0, along=(0.0, 0.0, 3.0))
    with pytest.raises(ValueError, match=r"bore of a coil must be two positive numbers"):
        Coil.straight_limb((0.0, 0.0, 0.0), AXIS, 0.1, (0.1, 0.1), 1.0)
    with pytest.raises(ValueError, match=r"radius of a circular coil, in m, must be a positive number"):
        Coil.circular((0.0, 0.0, 0.0), AXIS, 0.0, (0.1, 0.1), 1.0)
