"""Surfaces that boundaries may be given: their nearest points, and what they refuse."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import kohonen_adapt as ka

AXIS = (1.0, -2.0, 2.0)
SURFACES = {
    "plane": ka.Plane((0.1, 0.2, 0.3), AXIS),
    "sphere": ka.Sphere((0.1, 0.2, 0.3), 0.7),
    "cylinder": ka.Cylinder((0.1, 0.2, 0.3), AXIS, 0.7),
    "cone": ka.Cone((0.1, 0.2, 0.3), AXIS, 0.6),
}
each_surface = pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)


def equation(surface, x):
    """Zero on the surface: a distance to it or a multiple."""
    unit = np.array(AXIS)[:, None] / 3.0
    off = x - np.array([[0.1], [0.2], [0.3]])
    along = np.sum(off * unit, axis=0)
    around = np.sqrt(np.sum((off - unit * along) ** 2, axis=0))
    return {
        ka.Plane: along,
        ka.Sphere: np.sqrt(np.sum(off**2, axis=0)) - 0.7,
        ka.Cylinder: around - 0.7,
        ka.Cone: around - np.abs(along) * np.tan(0.6) + np.minimum(along, 0.0),
    }[type(surface)]


@each_surface
def test_the_nearest_points_are_on_it_and_none_is_nearer(surface):
    x = np.random.default_rng(0).uniform(-2, 2, (3, 200))
    kept, found = x.copy(), surface.project(x)
    assert_array_equal(x, kept)
    assert np.abs(equation(surface, found)).max() < 1e-14
    assert_allclose(surface.project(found), found, atol=1e-14)
    distance = np.linalg.norm(found - x, axis=0)
    others = surface.project(np.random.default_rng(1).uniform(-3, 3, (3, 5000)))
    nearest = np.min(np.linalg.norm(others[:, None, :] - x[:, :, None], axis=0), axis=1)
    assert np.all(distance <= nearest + 1e-12)
    assert np.all(nearest <= distance + 0.35)  # as dense as they are


@each_surface
@pytest.mark.parametrize("x", [np.zeros((2, 3)), np.zeros(3), [[np.nan], [0.0], [0.0]]])
def test_points_that_are_none(surface, x):
    with pytest.raises(ValueError, match=r"^x must (have shape \(3, n\); got|be finite; 1 of 1 points are not)"):
        surface.project(x)


WRONG = {
    r"point of a Plane must be three finite numbers \(x, y, z\); got \(0, 0\)\.": lambda: ka.Plane((0, 0), AXIS),
    r"normal of a Plane must not be zero\.": lambda: ka.Plane((0, 0, 0), (0, 0, 0)),
    r"centre of a Sphere must be three finite numbers .*": lambda: ka.Sphere((0, 0, np.inf), 1),
    r"radius of a Sphere must be a positive number; got -1\.": lambda: ka.Sphere((0, 0, 0), -1),
    r"radius of a Cylinder must be a positive number; got '1'\.": lambda: ka.Cylinder((0, 0, 0), AXIS, "1"),
    r"axis of a Cylinder must be three finite numbers .*": lambda: ka.Cylinder((0, 0, 0), "z", 1),
    r"half_angle of a Cone must be in radians, above 0 and below pi/2; got 45\.": lambda: ka.Cone((0, 0, 0), AXIS, 45),
    r"axis of a Cone must not be zero\.": lambda: ka.Cone((0, 0, 0), (0, 0, 0), 0.5),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_no_surface(message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        WRONG[message]()
