"""Plane and axisymmetric fields by NGSolve's elements of high order."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from skfem import MeshTri

from benchmarks.peers.media import Medium
from benchmarks.peers.ngsolve_force import VACUUM_PERMEABILITY, pull
from benchmarks.peers.ngsolve_mesh import curve_sides, element_numbers, netgen_mesh
from kohonen_adapt.cases.potentials import LinearPotential, TabulatedPotential
from kohonen_adapt.magnetostatics import Magnetostatics
from kohonen_adapt.magnetostatics.equations.conditions import circle_of
from kohonen_adapt.magnetostatics.quantities.cuts import mirror_cut, sector_cut, without_cancelled
from kohonen_adapt.mesh.curved import corners_of

MOST_STEPS, CONVERGED = 60, 1e-12  # of Newton's method; decrease of the functional, relative to its terms
POSITION_STEPS = 20  # of the fixed-point iteration for points in curved elements


class NgsolveField:
    """The field of a problem by elements of NGSolve, the minimiser of ``int w(B) - J A``.

    The unknown is A, and A / r around an axis, which is smooth there. Materials are evaluated at the integration
    points.

    Parameters
    ----------
    mesh, problem
        As for ``problem.solve``; sides of a `MeshTri2` are parabolas.
    order
        Order of the elements.
    """

    def __init__(self, mesh: MeshTri, problem: Magnetostatics, order: int) -> None:
        import ngsolve as ng

        self.ng, self.problem, self.order, self.skfem_mesh = ng, problem, order, corners_of(mesh)
        self.mesh = netgen_mesh(mesh, problem)
        self.offsets = curve_sides(mesh, self.mesh)  # kept alive: the mesh has no reference
        axisymmetric = problem.axisymmetric
        self.measure = 2 * np.pi * ng.x if axisymmetric else problem.depth or 1.0
        phase = [1] * len(problem.periodic) + [-1] * len(problem.antiperiodic)
        outer, joined = "|".join(problem.potential or []), bool(phase)
        plain = ng.H1(self.mesh, order=order, dirichlet=outer)
        self.space = ng.Periodic(plain, phase=phase) if -1 in phase else ng.Periodic(plain) if joined else plain
        self.rule = ng.comp.IntegrationRuleSpace(self.mesh, order=2 * order + 2)
        self.dx = ng.dx(intrules=self.rule.GetIntegrationRules())
        self.point_areas = self._point_areas()
        self.point_volumes = self.point_areas * self.at_points(ng.CF(self.measure))
        self.x = np.stack([self.at_points(ng.x), self.at_points(ng.y)])
        self.numbers = element_numbers(mesh, problem)
        self.element = self._elements_of_points()
        self.media = [Medium.of(given, self.points_in(name), self.x) for name, given in problem.materials.items()]
        self.current_density = self.mesh.MaterialCF(self._current_densities())
        self.potential = self._boundary_values()
        self._minimise()

    def at_points(self, density: Any) -> np.ndarray:
        """Return the values of a scalar at the integration points, (n,)."""
        values = self.ng.GridFunction(self.rule)
        values.Interpolate(density)
        return values.vec.FV().NumPy().copy()

    def _from_points(self, values: np.ndarray) -> Any:
        found = self.ng.GridFunction(self.rule)
        found.vec.FV().NumPy()[:] = values
        return found

    def _point_areas(self) -> np.ndarray:
        form = self.ng.LinearForm(self.rule.TestFunction() * self.dx).Assemble()
        return form.vec.FV().NumPy().copy()

    def _elements_of_points(self) -> np.ndarray:
        constants = self.ng.GridFunction(self.ng.L2(self.mesh, order=0))
        constants.vec.FV().NumPy()[:] = self.numbers
        return np.rint(self.at_points(constants)).astype(int)

    def elements_in(self, names: str | Sequence[str]) -> np.ndarray:
        """Return the elements of the mesh of scikit-fem in subdomains."""
        chosen = [names] if isinstance(names, str) else names
        return np.unique(np.concatenate([self.skfem_mesh.subdomains[name] for name in chosen]))

    def points_in(self, names: str | Sequence[str]) -> np.ndarray:
        """Return the integration points in subdomains."""
        return np.flatnonzero(np.isin(self.element, self.elements_in(names)))

    def _current_densities(self) -> dict[str, float]:
        density = {name: given.current_density for name, given in self.problem.materials.items()}
        for name, total in self.problem.ampere_turns.items():
            density[name] = total / self.point_areas[self.points_in(name)].sum()
        return density

    def _boundary_values(self) -> Any:
        found = self.ng.GridFunction(self.space)
        given = {name: self._as_unknown(value) for name, value in (self.problem.potential or {}).items()}
        if given:
            found.Set(self.mesh.BoundaryCF(given), definedon=self.mesh.Boundaries("|".join(given)))
        return found

    def _as_unknown(self, value: Any) -> Any:
        ng = self.ng
        if isinstance(value, LinearPotential):
            value = value.x_slope * ng.x + value.y_slope * ng.y + value.constant
        elif isinstance(value, TabulatedPotential):
            places, values = zip(*value.points, strict=True)
            table = ng.BSpline(2, [places[0], *places], list(values))
            value = table(ng.x if value.over == "x" else ng.y)
        return ng.CF(value) / ng.x if self.problem.axisymmetric else ng.CF(value)

    def scaled(self, unknown: Any) -> Any:
        """Return A of the unknown."""
        return unknown * self.ng.x if self.problem.axisymmetric else unknown

    def curl(self, unknown: Any) -> Any:
        ng, (right, up) = self.ng, (self.ng.grad(unknown)[0], self.ng.grad(unknown)[1])
        if self.problem.axisymmetric:
            return ng.CF((-ng.x * up, 2 * unknown + ng.x * right))
        return ng.CF((up, -right))

    @property
    def b(self) -> np.ndarray:
        """B at the integration points, (2, n) in T."""
        flux = self.curl(self.potential)
        return np.stack([self.at_points(flux[0]), self.at_points(flux[1])])

    def _joined(self, method: str, b: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        found = np.empty((*shape, b.shape[1]))
        for medium in self.media:
            found[..., medium.rows] = getattr(medium, method)(b[:, medium.rows])
        return found

    def _minimise(self) -> None:
        """Run Newton's method with step halving."""
        for _ in range(MOST_STEPS):
            step, decrease = self._newton_step()
            value, size = self._functional()
            if decrease <= CONVERGED * size:
                return
            start, factor = self.potential.vec.Copy(), 1.0
            while True:
                self.potential.vec.data = start + factor * step
                if self._functional()[0] <= value - 0.1 * factor * decrease + CONVERGED * size or factor < 1e-6:
                    break
                factor *= 0.5
        raise RuntimeError(f"NGSolve's field has not converged in {MOST_STEPS} steps of Newton's method.")

    def _newton_step(self) -> tuple[Any, float]:
        ng, b = self.ng, self.b
        u, v = self.space.TnT()
        xx, xy, yy = (self._from_points(each) for each in self._joined("tangent", b, (3,)))
        hx, hy = (self._from_points(each) for each in self._joined("strength", b, (2,)))
        bu, bv = self.curl(u), self.curl(v)
        tangent = xx * bu[0] * bv[0] + xy * (bu[0] * bv[1] + bu[1] * bv[0]) + yy * bu[1] * bv[1]
        form = ng.BilinearForm(self.space, symmetric=True)
        form += self.measure * tangent * self.dx
        load = ng.LinearForm(self.space)
        load += self.measure * (self.current_density * self.scaled(v) - hx * bv[0] - hy * bv[1]) * self.dx
        if self.problem.open_boundary:
            ds = ng.ds(self.problem.open_boundary)
            weight, applied = self._exterior
            form += weight * self.scaled(u) * self.scaled(v) * ds
            load += weight * (applied - self.scaled(self.potential)) * self.scaled(v) * ds
        form.Assemble()
        load.Assemble()
        step = self.potential.vec.CreateVector()
        step.data = form.mat.Inverse(self.space.FreeDofs(), inverse="sparsecholesky") * load.vec
        return step, 0.5 * float(ng.InnerProduct(step, load.vec))

    @cached_property
    def _exterior(self) -> tuple[Any, Any]:
        """Weight of ``A^2 / 2`` on the open boundary, and d times the potential A of the applied field.

        The exterior of a circle has the potential of a dipole, ``dA/dR = -A / R`` in the plane; around an axis r A has.
        """
        ng, problem = self.ng, self.problem
        (x0, y0), radius = circle_of(self.skfem_mesh, problem.open_boundary)
        hx, hy = problem.applied_field
        applied = 1.5 * hy * ng.x if problem.axisymmetric else 2 * (hx * (ng.y - y0) - hy * (ng.x - x0))
        return self.measure / (VACUUM_PERMEABILITY * radius), VACUUM_PERMEABILITY * applied

    def _functional(self) -> tuple[float, float]:
        """Return the functional, and the sum of the sizes of its terms."""
        terms = [self.energy, -self._work]
        if self.problem.open_boundary:
            weight, applied = self._exterior
            a = self.scaled(self.potential)
            boundary = self.mesh.Boundaries(self.problem.open_boundary)
            terms += [
                self.ng.Integrate(density, self.mesh, self.ng.BND, definedon=boundary, order=2 * self.order + 2)
                for density in (0.5 * weight * a * a, -weight * applied * a)
            ]
        return sum(terms), sum(map(abs, terms))

    @property
    def _work(self) -> float:
        density = self.current_density * self.scaled(self.potential)
        return float(self.point_volumes @ self.at_points(density))

    @property
    def energy(self) -> float:
        """``int H . dB`` since the remanent state, in J/m, with a depth and around an axis in J."""
        return float(self.point_volumes @ self._joined("energy", self.b, ()))

    def energy_in(self, part: str | Sequence[str]) -> float:
        """Return the energy of subdomains."""
        rows = self.points_in(part)
        return float(self.point_volumes[rows] @ self._joined("energy", self.b, ())[rows])

    @property
    def coenergy(self) -> float:
        """``int H . B`` less the energy."""
        b = self.b
        return float(self.point_volumes @ np.sum(self._joined("strength", b, (2,)) * b, axis=0)) - self.energy

    def force(self, body: str | Sequence[str]) -> np.ndarray:
        """Return the force (2,) in N/m, with a depth and around an axis in N."""
        cut = mirror_cut(self.skfem_mesh, self._inside(body))
        force = pull(self, body, cut).sum(axis=1)
        force = without_cancelled(cut, force, torque=False)
        return np.array([0.0, force[1]]) if self.problem.axisymmetric else force

    def torque(self, body: str | Sequence[str], centre: Sequence[float] = (0.0, 0.0)) -> float:
        """Return the torque about a centre in N m/m, with a depth in N m."""
        x, y = self.x - np.reshape(centre, (2, 1))
        right, up = pull(self, body, sector_cut(self.skfem_mesh, self._inside(body), np.array(centre)))
        return float(np.sum(x * up - y * right))

    def _inside(self, body: str | Sequence[str]) -> np.ndarray:
        return np.isin(np.arange(self.skfem_mesh.t.shape[1]), self.elements_in(body))

    def flux_linkage(self, coil: str | Sequence[str], turns: float = 1.0) -> float:
        """Return `turns` times the mean of A over a coil side, times the length of a turn."""
        rows = self.points_in(coil)
        along = self.point_volumes[rows] @ self.at_points(self.scaled(self.potential))[rows]
        return float(turns * along / self.point_areas[rows].sum())

    def potential_at(self, x: np.ndarray) -> np.ndarray:
        """Return A at points (2, n), (n,) in Wb/m."""
        return np.array([self.scaled(self.potential)(self._locate(point)) for point in x.T])

    def flux_density_at(self, x: np.ndarray, recovered: bool = False) -> np.ndarray:
        """Return B at points (2, n), (2, n) in T, of the elements even if `recovered`."""
        flux = self.curl(self.potential)
        return np.array([flux(self._locate(point)) for point in x.T]).T

    def _locate(self, point: np.ndarray) -> Any:
        """Return a point for NGSolve, which locates points in elements with straight sides."""
        at = point
        for _ in range(POSITION_STEPS if self.offsets is not None else 0):
            self.mesh.UnsetDeformation()
            offset = np.array(self.offsets(self.mesh(*at)))
            self.mesh.SetDeformation(self.offsets)
            at = point - offset
        return self.mesh(*at)
