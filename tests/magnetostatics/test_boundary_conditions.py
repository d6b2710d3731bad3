"""Open, periodic and antiperiodic boundaries of magnetostatics against exact fields and larger meshes."""

import numpy as np
import pytest
from helpers.meshes import SIDES, square
from skfem import MeshTri

from kohonen_adapt.magnetostatics import Magnetostatics, Material

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

AIR = {"air": Material(current_density=1e6)}
CELL = square(8).with_subdomains({"air": lambda x: x[0] < 2}).with_boundaries(SIDES)


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
    field = Magnetostatics(AIR, {"left": 0.25}, antiperiodic=[("right", "left")]).solve(CELL)
    right = np.unique(CELL.facets[:, CELL.boundaries["right"]])
    np.testing.assert_array_equal(field.potential[right], -0.25)
    message = (
        r"the potential 1 fixed at node \d+, .* contradicts its periodic or antiperiodic partner, which makes it -1"
    )
    with pytest.raises(ValueError, match=message):
        Magnetostatics(AIR, {"top": 1.0}, antiperiodic=[("left", "right")]).solve(CELL)


def test_a_periodic_mesh_alone_leaves_the_constant():
    with pytest.raises(ValueError, match=r"potential must fix A on at least one boundary"):
        Magnetostatics(AIR, periodic=[("left", "right")])
    with pytest.raises(ValueError, match=r"periodic must hold pairs of names of boundaries, as .*; got 'left'\."):
        Magnetostatics(AIR, {"top": 0.0}, periodic="left")
    sheared = MeshTri(CELL.p * np.where(CELL.p[0] == 0, [[1.0], [1.0 - 1e-3]], 1.0), CELL.t)
    sheared = sheared.with_subdomains(CELL.subdomains).with_boundaries(SIDES)
    message = (
        r"must carry the nodes of boundary 'left' .* In kohonen_adapt\.adapt: name the pair as periodic, too, or pin"
    )
    with pytest.raises(ValueError, match=message):
        Magnetostatics(AIR, {"top": 0.0}, periodic=[("left", "right")]).solve(sheared)
    with pytest.raises(ValueError, match=r"periodic has 'side', which is no boundary of the mesh"):
        Magnetostatics(AIR, {"top": 0.0}, periodic=[("left", "side")]).solve(CELL)
