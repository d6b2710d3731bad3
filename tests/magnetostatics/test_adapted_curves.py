"""A round magnet adapted on elements with curved sides: error, estimate, meshes of passes, solutions carried on."""

import numpy as np
import pytest
from helpers.round_magnet import (
    CENTRED_CURVES,
    CENTRED_SQUARED_NORM,
    CURVES,
    crowded_magnet_mesh,
    curved_magnet_mesh,
    magnet_error,
    magnet_mesh,
    magnet_problem,
)
from skfem import Basis, ElementTriP2, MeshTri, MeshTri2

import kohonen_adapt as ka
from kohonen_adapt.mesh.measures import area


def adapted(order=2, curved=True, rings=10, passes=2, **options):
    return ka.adapt(magnet_mesh(rings), magnet_problem(order, curved), passes=passes, **options)


def on_circles(mesh):
    """How far the middles of sides on both circles are off them."""
    off = []
    for name, arc in CURVES.items():
        middles = mesh.doflocs[:, mesh.nvertices + mesh.boundaries[name]] - np.reshape(arc.centre, (2, 1))
        off.append(np.abs(np.hypot(*middles) - arc.radius).max())
    return max(off)


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("rtol", [0.3, 0.01])
def test_an_estimate_within_its_tolerance_includes_sides_off_their_curves(order, rtol):
    """The first on sides that are flattened, the second on parabolas in place of arcs, which count at order 3."""
    result = ka.adapt(crowded_magnet_mesh(1.12), magnet_problem(order), curves=CENTRED_CURVES, rtol=rtol)
    lacking = np.sqrt(abs(1.0 - result.solution.squared_norm / CENTRED_SQUARED_NORM))
    assert result.status is ka.Status.CONVERGED and lacking < 1.2 * rtol
    assert result.estimate / result.best.energy_norm == pytest.approx(lacking, rel=0.15 if order == 2 else 0.05)


@pytest.mark.parametrize("order", [2, 3])
def test_every_pass_is_solved_on_the_circles(order):
    """The input's, too: its nodes stay, its sides are bent. The exact field is met five times as well as on chords."""
    result, chords = adapted(order, passes=3), adapted(order, curved=False, passes=3)
    for step in result.history:
        assert type(step.mesh) is MeshTri2 and on_circles(step.mesh) < 1e-9
        assert step.unknowns == Basis(step.mesh, ElementTriP2()).N or order == 3
    start = curved_magnet_mesh(10)
    np.testing.assert_allclose(result.history[0].mesh.doflocs, start.doflocs, atol=1e-12)
    first, last = (magnet_error(field) for field in (magnet_problem(order).solve(start), result.solution))
    assert last < 0.8 * first  # of which parabolas for arcs are a part
    assert last < 0.2 * magnet_error(chords.solution)
    assert all(type(step.mesh) is MeshTri for step in chords.history)
    assert area(result.mesh).sum() == pytest.approx(np.pi, rel=1e-4)
    assert [step.comparable for step in result.history] == [order == 2] * len(result.history)
    assert all(step.polish_gain > 0.0 for step in result.history[1:])


@pytest.mark.parametrize("order", [2, 3])
def test_errors_of_outputs_include_sides_that_are_flattened_for_the_polish(order):
    result = ka.adapt(
        crowded_magnet_mesh(1.12),
        magnet_problem(order),
        passes=0,
        curves=CENTRED_CURVES,
        outputs={"norm": lambda field: field.squared_norm},
        output_rtol=1e-6,
    )
    value, error = result.outputs["norm"].value, result.outputs["norm"].error
    assert error == pytest.approx(CENTRED_SQUARED_NORM - value, rel=0.1)
