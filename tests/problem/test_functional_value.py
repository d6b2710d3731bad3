"""Values of a `Ritz` in closed form, and the derivatives that the check of a solution takes."""

import numpy as np
import pytest
from helpers.meshes import square
from skfem import Basis, ElementTetP1, ElementTetP2, MeshTet, MeshTri

from kohonen_adapt import Ritz
from kohonen_adapt.mesh.curved import with_midside_offsets
from kohonen_adapt.mesh.elements.functions import KINDS
from kohonen_adapt.polishing.stationarity import derivatives_on
from kohonen_adapt.problem.boundary_terms import SurfaceTerms
from kohonen_adapt.problem.functional_value import coefficients_on, functional_value, numbers_of, offsets_on, value_on

IN_SPACE = {1: ElementTetP1, 2: ElementTetP2}


class Power:
    """Law H(b) = b^3."""

    def field_strength(self, b):
        return b**3

    def energy(self, b):
        return b**4 / 4.0


def shaken(kind, count):
    """The unit square or cube, its inner nodes moved."""
    at = np.linspace(0.0, 1.0, count)
    mesh, random = kind.init_tensor(*[at] * {MeshTri: 2, MeshTet: 3}[kind]), np.random.default_rng(0)
    inner = np.all((mesh.p > 0.0) & (mesh.p < 1.0), axis=0)
    return kind(mesh.p + 0.2 / count * inner * random.uniform(-1.0, 1.0, mesh.p.shape), mesh.t).with_defaults()


def bent(mesh):
    """The same mesh with curved sides inside."""
    random = np.random.default_rng(1)
    if mesh.dim() == 2:
        inner = mesh.f2t[1] >= 0
        return with_midside_offsets(mesh, 0.02 * inner * random.uniform(-1.0, 1.0, (2, inner.size)))
    mesh.f2t, mesh.edges  # noqa: B018
    outer = np.isin(np.arange(mesh.edges.shape[1]), mesh.boundary_edges())
    return with_midside_offsets(mesh, 0.01 * ~outer * random.uniform(-1.0, 1.0, (3, outer.size)))


def positions(mesh, order):
    element = KINDS[order]() if mesh.dim() == 2 else IN_SPACE[order]()
    return Basis(mesh, element).doflocs


def ritz_of(mesh, function, order, **terms):
    corners = (MeshTri if mesh.dim() == 2 else MeshTet)(mesh.p[:, : mesh.nvertices], mesh.t)
    x = positions(corners, order)
    if mesh.p.shape[1] > mesh.nvertices and order == 2:
        x = np.hstack((x[:, : mesh.nvertices], mesh.p[:, mesh.nvertices :]))
    values = function(x)
    return Ritz(values, np.zeros(values.size, dtype=bool), order=order, **terms)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_polynomials_on_a_square(order):
    mesh = shaken(MeshTri, 5)
    terms = {"coefficient": 3.0, "source": 2.0, "flux": np.array([0.5, 0.25]), "robin": {"right": (4.0, 5.0)}}
    found = functional_value(mesh, ritz_of(mesh, lambda x: x[0] ** order, order, **terms))
    stored = 1.5 * order**2 / (2 * order - 1)
    assert found == pytest.approx(stored - 2.0 / (order + 1) - 0.5 + 2.0 - 5.0, rel=1e-13)
    terms["source"] = lambda x, region: x[0] ** 3 * x[1]
    found = functional_value(mesh, ritz_of(mesh, lambda x: x[0] ** order, order, **terms))
    assert found == pytest.approx(stored - 0.5 / (order + 4) - 0.5 + 2.0 - 5.0, rel=1e-13)


@pytest.mark.parametrize("order", [1, 2])
def test_polynomials_in_a_cube(order):
    mesh, shift = shaken(MeshTet, 4), np.array([0.0, 0.5, 0.0])
    terms = {"coefficient": 3.0, "source": 2.0, "flux": np.array([0.5, 0.25, 1.0]), "shift": shift}
    ritz = ritz_of(mesh, lambda x: x[0] ** order + x[1], order, **terms)
    stored, flux = 1.5 * (order**2 / (2 * order - 1) + 1.0), 0.75
    assert functional_value(mesh, ritz) == pytest.approx(stored - 2.0 / (order + 1) - 1.0 - flux, rel=1e-13)
    nodal = np.zeros((np.size(ritz.values), 2))
    nodal[:] = 7.0, 1.0  # u - 7 everywhere, with loads of 1
    surface = SurfaceTerms(nodal, np.array([True]), lambda mesh: nodal)
    reduced = functional_value(mesh, ritz_of(mesh, lambda x: x[0] ** order + x[1], order, surface=surface, **terms))
    work = np.sum(np.asarray(ritz.values) - 7.0)
    assert reduced == pytest.approx(functional_value(mesh, ritz) + 14.0 - work, rel=1e-12)
    law = ritz_of(mesh, lambda x: x[0] ** order + x[1], order, laws=[Power()], **terms)
    quartic = {1: 1.25**2, 2: 16.0 / 5.0 + 2.0 / 3.0 + 0.0625}[order] / 4.0  # |(order x^(order - 1), 1 / 2)|^4 / 4
    assert functional_value(mesh, law) == pytest.approx(quartic - 2.0 / (order + 1) - 1.0 - flux, rel=1e-12)


@pytest.mark.parametrize("law", [False, True])
@pytest.mark.parametrize("kind", [MeshTri, MeshTet])
def test_linear_functions_in_curved_elements(kind, law):
    mesh = bent(shaken(kind, 4))
    laws = [Power()] if law else ()
    ritz = ritz_of(mesh, lambda x: x[0] + 2.0 * x[1], 2, coefficient=3.0, source=2.0, laws=laws)
    wanted = (25.0 / 4.0 if law else 7.5) - 3.0
    assert functional_value(mesh, ritz) == pytest.approx(wanted, rel=1e-12 if kind is MeshTri else 2e-3)


def test_a_layer_is_integrated_in_parts_of_elements():
    mesh = square(16)
    width = 1.0 / 60.0
    source = lambda x, region: np.exp(-(((x[0] - 0.47) / width) ** 2))  # noqa: E731
    ritz = ritz_of(mesh, lambda x: np.ones(x.shape[1]), 1, coefficient=1.0, source=source)
    assert functional_value(mesh, ritz) == pytest.approx(-np.sqrt(np.pi) * width, rel=1e-5)


@pytest.mark.parametrize("source", ["constant", "function"])
@pytest.mark.parametrize("law", [False, True])
@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize(
    ("kind", "order", "axis"),
    [(MeshTri, 1, False), (MeshTri, 2, False), (MeshTri, 3, False), (MeshTri, 1, True), (MeshTri, 2, True)]
    + [(MeshTri, 3, True), (MeshTet, 1, False), (MeshTet, 2, False)],
)
def test_residuals_are_the_derivatives_of_the_value(kind, order, axis, curved, law, source):
    mesh = shaken(kind, 4)
    mesh, random = bent(mesh) if curved else mesh, np.random.default_rng(2)
    region = random.integers(0, 2, mesh.nelements)
    given = np.array([1.0, 2.0]) if source == "constant" else lambda x, region: np.cos(x[0]) * (1.0 + region)
    shift = 0.0 if kind is MeshTri else random.normal(size=(3, 2))
    terms = {"coefficient": [2.0, 3.0], "source": given, "flux": random.normal(size=(mesh.dim(), 2)), "shift": shift}
    terms |= {"region": region, "axisymmetric": axis, "laws": [None, Power()] if law else ()}
    ritz = ritz_of(mesh, lambda x: x[0] ** 2 * np.exp(x[1]), order, **terms)
    number, offset, corners = numbers_of(ritz, mesh), offsets_on(mesh, ritz), mesh.p[:, mesh.t]
    coefficients = coefficients_on(mesh, ritz, number)
    found = derivatives_on(corners, coefficients, number, ritz, offset)
    change = 1e-5 * random.normal(size=coefficients.shape)
    before, after = (value_on(corners, coefficients + sign * change, number, ritz, offset) for sign in (-1.0, 1.0))
    tolerance = 1e-6 * np.sum(found.size * np.abs(change))
    assert np.sum(found.total * change) == pytest.approx(0.5 * (after - before), abs=tolerance)
    assert np.all(np.abs(found.total) <= found.size * (1.0 + 1e-12))
