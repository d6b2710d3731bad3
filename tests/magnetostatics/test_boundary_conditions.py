"""Open, periodic and antiperiodic boundaries of magnetostatics against exact fields and larger meshes."""

import numpy as np
import pytest
from helpers.meshes import square
from skfem import MeshTri

from kohonen_adapt.magnetostatics import Brauer, Magnetostatics, Material

STEEL = Brauer(100.0, 10.0, 1.8)

# --- the open boundary -------------------------------------------------------------------------------------------


def test_an_open_boundary_is_a_circle_of_the_outer_boundary():
    mesh = square(4).with_subdomains({"air": lambda x: x[0] < 2})
    mesh = mesh.with_boundaries({"all": lambda x: x[0] > -1, "left": lambda x: x[0] == 0.0})
    problem = {"materials": {"air": Material(current_density=1.0)}}
    with pytest.raises(ValueError, match=r"'all' must be a circle, or an arc; its nodes are 0\.5 to 0\.707107 m from"):
        Magnetostatics(**problem, open_boundary="all").solve(mesh)
    with pytest.raises(ValueError, match=r"'left' must be a circle, or an arc"):
        Magnetostatics(**problem, open_boundary="left").solve(mesh)
    with pytest.raises(ValueError, match=r"boundary 'rim' is not in the mesh; it has 'all', 'left'\."):
        Magnetostatics(**problem, open_boundary="rim").solve(mesh)
    inner = mesh.with_boundaries({"inner": lambda x: x[0] == 0.5}, boundaries_only=False)
    with pytest.raises(ValueError, match="the open boundary 'inner' must be on the outer boundary of the mesh"):
        Magnetostatics(**problem, open_boundary="inner").solve(inner)


# --- periodic and antiperiodic pairs -------------------------------------------------------------------------------

SIDES = {
    "left": lambda x: x[0] == x[0].min(),
    "right": lambda x: x[0] == x[0].max(),
    "bottom": lambda x: x[1] == x[1].min(),
    "top": lambda x: x[1] == x[1].max(),
}


def row(*signs, n=8):
    """Unit cells side by side, each with iron, a coil and a magnet of that sign, and the materials."""
    count = len(signs)
    mesh = MeshTri.init_tensor(np.linspace(0, count, n * count + 1), np.linspace(0, 1, n + 1))
    cell, (x, y) = np.floor(mesh.p[0, mesh.t].mean(axis=0)), mesh.p[:, mesh.t].mean(axis=1) % 1.0
    places = {"coil": (x < 0.25) & (y < 0.5), "magnet": (abs(x - 0.5) < 0.125) & (y > 0.5), "iron": x > 0.625}
    places["air"] = ~(places["coil"] | places["magnet"] | places["iron"])
    parts = {f"{name} {k}": np.flatnonzero(at & (cell == k)) for name, at in places.items() for k in range(count)}
    materials = {}
    for k, sign in enumerate(signs):
        materials[f"coil {k}"] = Material(current_density=sign * 1e6)
        materials[f"magnet {k}"] = Material(1.05, remanence=(0.3 * sign, 1.1 * sign))
        materials |= {f"iron {k}": Material(bh=STEEL), f"air {k}": Material()}
    return mesh.with_subdomains(parts).with_boundaries(SIDES), materials


def at(mesh, field, x):
    return field.potential_at(np.asarray(x))


POINTS = np.random.default_rng(0).uniform(0.01, 0.99, (2, 50))


def test_a_cell_antiperiodic_both_ways_needs_no_given_value():
    (one, of_one), (two, of_two) = row(1), row(1, -1)
    single = Magnetostatics(of_one, antiperiodic=[("left", "right"), ("bottom", "top")]).solve(one)
    double = Magnetostatics(of_two, periodic=[("left", "right")], antiperiodic=[("bottom", "top")]).solve(two)
    corner = [one.p[0].round(9), one.p[1].round(9)]
    values = {(x, y): a for x, y, a in zip(*corner, single.potential, strict=True)}
    assert values[0, 0] == -values[1, 0] == -values[0, 1] == values[1, 1] != 0.0
    largest = np.abs(single.potential).max()
    np.testing.assert_allclose(double.potential_at(POINTS), single.potential_at(POINTS), atol=1e-7 * largest)


def test_the_centre_of_an_antiperiodic_rotation_is_zero():
    """A half plane turned by 180 degrees: left and right halves of the bottom side are one, its middle is its own."""
    mesh = square(8).with_subdomains({"air": lambda x: x[0] < 2})
    mesh = mesh.with_boundaries(
        {
            "one": lambda x: (x[1] == 0) & (x[0] < 0.5),
            "other": lambda x: (x[1] == 0) & (x[0] > 0.5),
            "rest": lambda x: x[1] > 0,
        }
    )
    problem = Magnetostatics({"air": Material(current_density=1e6)}, antiperiodic=[("one", "other")])
    field = problem.solve(mesh)
    middle = np.flatnonzero((mesh.p[0] == 0.5) & (mesh.p[1] == 0.0))[0]
    assert field.potential[middle] == 0.0
    bottom = np.flatnonzero(mesh.p[1] == 0)
    order = bottom[np.argsort(mesh.p[0, bottom])]
    np.testing.assert_array_equal(field.potential[order], -field.potential[order[::-1]])


def test_a_value_given_on_one_side_holds_on_the_other():
    mesh, materials = row(1)
    field = Magnetostatics(materials, {"left": 0.25}, antiperiodic=[("right", "left")]).solve(mesh)
    right = np.unique(mesh.facets[:, mesh.boundaries["right"]])
    np.testing.assert_array_equal(field.potential[right], -0.25)
    message = (
        r"the potential 1 fixed at node \d+, .* contradicts its periodic or antiperiodic partner, which makes it -1"
    )
    with pytest.raises(ValueError, match=message):
        Magnetostatics(materials, {"top": 1.0}, antiperiodic=[("left", "right")]).solve(mesh)


def test_a_periodic_mesh_alone_leaves_the_constant():
    mesh, materials = row(1)
    with pytest.raises(ValueError, match=r"potential must fix A on at least one boundary"):
        Magnetostatics(materials, periodic=[("left", "right")])
    with pytest.raises(ValueError, match=r"periodic must hold pairs of names of boundaries, as .*; got 'left'\."):
        Magnetostatics(materials, {"top": 0.0}, periodic="left")
    sheared = MeshTri(mesh.p * np.where(mesh.p[0] == 0, [[1.0], [1.0 - 1e-3]], 1.0), mesh.t)
    sheared = sheared.with_subdomains(mesh.subdomains).with_boundaries(SIDES)
    message = (
        r"must carry the nodes of boundary 'left' .* In kohonen_adapt\.adapt: name the pair as periodic, too, or pin"
    )
    with pytest.raises(ValueError, match=message):
        Magnetostatics(materials, {"top": 0.0}, periodic=[("left", "right")]).solve(sheared)
    with pytest.raises(ValueError, match=r"periodic has 'side', which is no boundary of the mesh"):
        Magnetostatics(materials, {"top": 0.0}, periodic=[("left", "side")]).solve(mesh)
