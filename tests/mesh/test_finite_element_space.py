"""One finite element space for all orders, dimensions and shapes: against scikit-fem, polynomials and itself."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import skfem
from numpy.testing import assert_allclose, assert_array_equal
from skfem import BilinearForm, LinearForm
from skfem.helpers import dot

from kohonen_adapt.mesh.elements.functions import nodes
from kohonen_adapt.mesh.elements.rules import CURVED_RULE_IN_SPACE, LAW_DEGREE, LAW_DEGREE_BY_POINTS, LAW_RULE_IN_SPACE
from kohonen_adapt.mesh.elements.space import Space

ELEMENTS = {
    (1, 2): skfem.ElementTriP1,
    (2, 2): skfem.ElementTriP2,
    (3, 2): skfem.ElementTriP3,
    (1, 3): skfem.ElementTetP1,
    (2, 3): skfem.ElementTetP2,
}


def plane(curved=False, steps=4):
    rng = np.random.default_rng(steps)
    mesh = skfem.MeshTri.init_tensor(*[np.linspace(0.0, 1.0, steps + 1)] * 2)
    inner = np.all((mesh.p > 0.0) & (mesh.p < 1.0), axis=0)
    mesh = replace(mesh, doflocs=mesh.p + inner * rng.uniform(-0.1, 0.1, mesh.p.shape) / steps)
    return bowed(skfem.MeshTri2.from_mesh(mesh), mesh.facets, rng) if curved else mesh


def solid(curved=False, steps=2):
    rng = np.random.default_rng(steps)
    mesh = skfem.MeshTet.init_tensor(*[np.linspace(0.0, 1.0, steps + 1)] * 3)
    mesh = replace(mesh, t=rng.permuted(mesh.t, axis=0))  # corners in any order
    inner = np.all((mesh.p > 0.0) & (mesh.p < 1.0), axis=0)
    mesh = replace(mesh, doflocs=mesh.p + inner * rng.uniform(-0.1, 0.1, mesh.p.shape) / steps)
    return bowed(skfem.MeshTet2.from_mesh(mesh), mesh.edges, rng) if curved else mesh


def bowed(mesh, sides, rng):
    # sides on x = 0 stay straight, some others have an offset
    p, ends = mesh.doflocs.copy(), mesh.doflocs[:, sides]
    some = (rng.random(sides.shape[1]) < 0.4) & (ends[0].max(axis=0) > 1e-9)
    offset = rng.uniform(-0.06, 0.06, ends[:, 0].shape) * np.linalg.norm(ends[:, 0] - ends[:, 1], axis=0)
    p[:, mesh.nvertices :] += np.where(some, offset, 0.0)
    return replace(mesh, doflocs=p)


def law_of(mesh):
    return np.random.default_rng(1).random(mesh.t.shape[1]) < 0.4


VARIANTS = [
    *product(("plane", "axis"), range(1, 9), (False, True), (False, True)),
    *product(("solid",), range(1, 6), (False, True), (False, True)),
]


def is_served(kind, order, curved):
    return not (curved and order == 1 and kind != "axis")


@pytest.fixture(
    scope="module",
    params=[each for each in VARIANTS if is_served(*each[:3])],
    ids=lambda each: f"{each[0]}-{each[1]}{'-curved' * each[2]}{'-law' * each[3]}",
)
def space(request):
    kind, order, curved, law = request.param
    mesh = solid(curved) if kind == "solid" else plane(curved)
    return Space(mesh, order, law_of(mesh) if law else None, kind == "axis")


def values_of(space):
    u = np.random.default_rng(2).normal(size=space.doflocs.shape[1])
    return np.where(space.doflocs[0] > 1e-9, u, 0.0) if space.axis else u


def coefficient(space, x, element):
    # varies inside elements with a law only
    inside = 1.0 + 0.3 * np.sin(5.0 * x[0] + 3.0 * x[-1])
    found = (1.0 + element % 3) * np.where(space.nonlinear[element], inside, 1.0)
    return found / x[0] if space.axis else found


def along(space, x, element):
    unit = np.zeros_like(x)
    unit[:2] = np.cos(4.0 * x[1]), np.sin(4.0 * x[1])
    return np.where(space.nonlinear[element], 2.5, 1.0) * coefficient(space, x, element), unit


def close(found, expected, tolerance=1e-12):
    assert_allclose(found, expected, rtol=0.0, atol=tolerance * max(np.abs(expected).max(), 1e-300))


def test_matrices_are_the_derivatives_of_the_residual(space):
    u, at = values_of(space), (space.points, space.element)
    fixed = np.unique(space.on_facets(space.corners.boundary_facets()[::2]))
    u[fixed], free = 0.0, np.setdiff1d(np.arange(u.size), fixed)
    slope, across, (ahead, unit) = space.gradient(u), coefficient(space, *at), along(space, *at)
    flux = across * slope + (ahead - across) * np.sum(unit * slope, axis=0) * unit
    for nu, tensor, total in ((across, None, across * slope), (across, (ahead, unit), flux)):
        system = space.stiffness(nu, free, tensor)
        right = space.assemble_vector(space.against_gradients(total))[free]
        rows = np.arange(free.size) if system.rows is None else system.rows
        close(system.matrix @ u[free][rows], system.eliminated(right))
        close(system.completed(u[free][rows], right), u[free], 1e-9)
        close(system.matrix.toarray(), system.matrix.toarray().T)


def test_loads_are_dual_to_gradients(space):
    u, x = values_of(space), space.points
    flux = np.stack([np.sin(3.0 * x[0]), *np.cos(2.0 * x[1:])])
    source = 1.0 + np.arange(space.volumes.size) % 4
    found = space.loads(source, flux) @ u
    gradients = np.sum(space.weights * np.sum(flux * space.gradient(u), axis=0))
    close(found, gradients + space.volumes @ (source * space.mean_function(u)))


def test_values_at_points_are_those_at_quadrature_points(space):
    u, element, at = values_of(space), space.element, space.barycentric_of_points
    close(space.gradient_at(u, element, at), space.gradient(u))
    close(space.shape.points(element, at), space.points)
    close(space.barycentric(space.points, element), at, 1e-9)
    few = np.random.default_rng(3).dirichlet(np.ones(space.dim + 1), 3)
    each = np.tile(np.arange(space.volumes.size), 3), np.repeat(few.T, space.volumes.size, axis=1)
    close(space.gradient_in_each(u, few), space.gradient_at(u, *each))
    close(space.in_each(u, few).ravel(), space.at(u, *each))
    close(space.in_each(u, nodes(space.order, space.dim, space.arcs))[:, 0], u[space.unknowns[:, 0]], 1e-11)


def test_loads_at_points_act_on_all_functions_alike(space):
    rng, u = np.random.default_rng(4), values_of(space)
    if space.dim == 3 and space.curved.any():
        return
    element, at = rng.integers(0, 5, 12), rng.dirichlet(np.ones(space.dim + 1), 12).T
    vectors = rng.normal(size=(space.dim, 12))
    load = space.load_at(element, at, vectors)
    found = np.sum(space.weights * np.sum(load * space.gradient(u), axis=0))
    close(found, np.sum(vectors * space.gradient_at(u, element, at)), 1e-9)


@pytest.mark.parametrize(
    ("order", "dim", "curved", "law"),
    [each for each in product((1, 2, 3), (2, 3), (False, True), (False, True)) if each[:2] in ELEMENTS],
)
def test_all_is_as_of_scikit_fem(order, dim, curved, law):
    if order == 1 and curved:
        return
    mesh = plane(curved) if dim == 2 else solid(curved)
    space = Space(mesh, order, np.full(mesh.t.shape[1], law))
    basis = skfem.Basis(mesh, ELEMENTS[order, dim](), intorder=2)
    assert_array_equal(space.unknowns, basis.element_dofs)
    close(space.doflocs, basis.doflocs, 1e-14)
    parts = [(space.curved == part, rule_of(space, order, part, law)) for part in (False, True)]
    bases = [
        skfem.Basis(mesh, ELEMENTS[order, dim](), elements=np.flatnonzero(rows), **rule)
        for rows, rule in parts
        if rows.any()
    ]
    power = 1.0 * (law and order > 1)
    stiffness = BilinearForm(lambda u, v, w: (1.0 + power * w.x[0] ** 2) * dot(u.grad, v.grad))
    load = LinearForm(lambda v, w: v + w.x[1] * v.grad[0])
    system = space.stiffness(1.0 + power * space.points[0] ** 2, np.arange(space.doflocs.shape[1]))
    close(system.matrix.toarray(), sum(stiffness.assemble(each) for each in bases).toarray())
    flux = np.zeros_like(space.points)
    flux[0] = space.points[1]
    found = space.loads(np.ones(space.volumes.size), flux)
    close(found, sum(load.assemble(each) for each in bases))
    assert space.volumes.sum() == pytest.approx(sum(each.dx.sum() for each in bases), rel=1e-13)


def rule_of(space, order, curved, law):
    if space.dim == 3 and order > 1:
        points, weights = LAW_RULE_IN_SPACE if law else CURVED_RULE_IN_SPACE
        if law or curved:
            return {"quadrature": (points[:, 1:].T, weights / 6.0)}
        return {"intorder": 2 * order}
    if law and order > 1:
        return {"intorder": (LAW_DEGREE_BY_POINTS if curved else LAW_DEGREE)[order]}
    return {"intorder": 2 * order + 2 * curved}


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("order", range(1, 9))
def test_masses_of_facets_are_integrals_of_squares(order, curved):
    mesh = plane(curved and order > 1)
    space = Space(mesh, order)
    facets = space.corners.boundary_facets()
    u, weight = space.doflocs[1] ** order, 1.0 + np.arange(facets.size) % 3
    own = u[space.on_facets(facets)]
    found = np.einsum("if,jf,ijf->f", own, own, space.products_on(facets, weight))
    if space.curved.any():
        length = np.einsum("ijf->f", space.products_on(facets, weight)) / weight
        chord = np.linalg.norm(np.diff(space.corners.p[:, space.corners.facets[:, facets]], axis=1)[:, 0], axis=0)
        assert np.all(length > chord * (1.0 - 1e-12))
        assert np.any(length > chord * 1.0001)
        return
    start, end = space.corners.p[:, space.corners.facets[:, facets]].swapaxes(0, 1)
    at, of_point = np.polynomial.legendre.leggauss(order + 1)
    y = start[1] + np.multiply.outer(0.5 + 0.5 * at, end[1] - start[1])
    close(found, weight * np.hypot(*(end - start)) * (0.5 * of_point @ y ** (2 * order)))


def test_arcs_that_fold_an_element_are_refused():
    mesh = plane(True)
    p = mesh.doflocs.copy()
    inner = np.flatnonzero(mesh.f2t[1] >= 0)[0]
    start, end = p[:, mesh.facets[:, inner]].T
    p[:, mesh.nvertices + inner] = 0.5 * (start + end) + 1.2 * np.array([start[1] - end[1], end[0] - start[0]])
    with pytest.raises(ValueError, match="arcs must not fold elements of order 4 and above; they fold"):
        Space(replace(mesh, doflocs=p), 4).weights  # noqa: B018


@pytest.mark.parametrize("order", range(2, 9))
def test_masses_around_an_axis_have_the_factor_of_the_radius(order):
    space = Space(plane(), order, axis=True)
    facets = space.corners.boundary_facets()
    facets = facets[space.corners.p[0, space.corners.facets[:, facets]].max(axis=0) > 1e-9]
    u = space.doflocs[0, space.on_facets(facets)] ** 2
    total = np.einsum("if,jf,ijf->", u, u, space.products_on(facets, np.ones(facets.size)))
    assert total == pytest.approx(1.0 + 2.0 / 4.0, rel=1e-12)  # int r^3 along both ends, and 1 at r = 1


def test_tetrahedra_of_order_one_have_four_points_if_a_field_varies():
    mesh = solid()
    one, four = Space(mesh, 1), Space(mesh, 1, varies=True)
    u = np.random.default_rng(6).normal(size=mesh.nvertices)
    assert four.points.shape[1] == 4 * one.points.shape[1]
    close(four.gradient(u), one.gradient(u))
    close(four.gradient_at_points(u), np.tile(one.gradient(u), 4))
    close(four.mean(four.points[0] ** 2), np.einsum("q,qm->m", np.full(4, 0.25), four.points[0].reshape(4, -1) ** 2))
    close(four.gradient_weights, one.weights)
