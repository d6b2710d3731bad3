"""Compare energies, forces and fluxes of adapted meshes with NGSolve's P3 elements on the same polygon."""

import runpy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems.p1 import area
from benchmarks.table import aligned
from kohonen_adapt.magnetostatics import Froehlich, Magnetostatics, Material

EXAMPLES = Path(__file__).parents[2] / "examples"
ORDER = 3
VACUUM_PERMEABILITY = 4e-7 * np.pi
LINEAR, SATURATING = Material(1000.0), Material(bh=Froehlich(2000.0, 0.8))
GAP = np.array([[0.015, 0.030], [0.0, 0.0]])  # m, ends of a line across the flux in the gap of the C-core


@dataclass(frozen=True)
class Device:
    """A problem, its start mesh, its output besides the energies, of a field and by the oracle, options of `adapt`."""

    name: str
    mesh: MeshTri
    problem: Magnetostatics
    output: str
    ours: Callable[[Any], float]
    theirs: Callable[["Oracle"], float]
    options: dict[str, Any] = field(default_factory=dict)


class Oracle:
    """The field of a problem in P3 elements of NGSolve on a mesh: minimiser of ``int w(B) - J A``.

    Laws are those of Froehlich and linear ones. Around an axis the unknown is A / r, which is smooth there.
    """

    def __init__(self, mesh: MeshTri, problem: Magnetostatics) -> None:
        import ngsolve as ng

        self.ng, self.problem = ng, problem
        self.mesh = netgen_mesh(mesh, problem)
        outer = "|".join(problem.potential)
        self.measure = 2 * np.pi * ng.x if problem.axisymmetric else 1.0
        plain = ng.H1(self.mesh, order=ORDER, dirichlet=outer)
        joined = bool(problem.antiperiodic)
        self.weights = ng.Periodic(plain) if joined else plain
        self.space = ng.Periodic(plain, phase=[-1]) if joined else plain
        sizes = {name: area(mesh)[mesh.subdomains[name]].sum() for name in problem.materials}
        turns = {name: total / sizes[name] for name, total in problem.ampere_turns.items()}
        density = {name: turns.get(name, given.current_density) for name, given in problem.materials.items()}
        self.current_density = self.mesh.MaterialCF(density)
        self.potential = self._minimiser()
        self.flux_density = self._curl(self.potential)

    def _minimiser(self) -> Any:
        ng, potential = self.ng, self.ng.GridFunction(self.space)
        form = ng.BilinearForm(self.space, symmetric=True)
        trial = self.space.TrialFunction()
        density = self._energy_density(self._curl(trial)) - self.current_density * self._scaled(trial)
        form += ng.Variation(self.measure * density * ng.dx)
        failed, steps = ng.solvers.NewtonMinimization(form, potential, linesearch=True, maxerr=1e-10, printing=False)
        if failed:
            raise RuntimeError(f"NGSolve's Newton method has not converged in {steps} steps.")
        return potential

    def _scaled(self, unknown: Any) -> Any:
        """A of the unknown."""
        return unknown * self.ng.x if self.problem.axisymmetric else unknown

    def _curl(self, potential: Any) -> Any:
        ng = self.ng
        right, up = ng.grad(potential)[0], ng.grad(potential)[1]
        if self.problem.axisymmetric:
            return ng.CF((-ng.x * up, 2 * potential + ng.x * right))
        return ng.CF((up, -right))

    def _energy_density(self, b: Any) -> Any:
        """By material, in J/m^3."""
        laws = {name: self._law(given, b) for name, given in self.problem.materials.items()}
        return self.mesh.MaterialCF(laws)

    def _law(self, given: Material, b: Any) -> Any:
        ng = self.ng
        if given.bh is None:
            off = b - ng.CF(tuple(given.remanence))
            return 0.5 * given.reluctivity * ng.InnerProduct(off, off)
        slope, bs = given.reluctivity, given.bh.saturation
        end = bs * (1 - given.bh.permeability**-0.5)  # from there on dB/dH is that of vacuum
        size = ng.sqrt(ng.InnerProduct(b, b) + 1e-16)
        inside, beyond = ng.IfPos(end - size, size, end), ng.IfPos(size - end, size - end, 0.0)
        energy = slope * bs**2 * (-ng.log(1 - inside / bs) - inside / bs)
        return energy + slope * end / (1 - end / bs) * beyond + 0.5 / VACUUM_PERMEABILITY * beyond**2

    def integral(self, density: Any) -> float:
        """Over the mesh; axisymmetric around the axis."""
        return float(self.ng.Integrate(self.measure * density, self.mesh, order=2 * ORDER + 2))

    @property
    def energy(self) -> float:
        """Stored since the remanent state, in J per metre or J."""
        return self.integral(self._energy_density(self.flux_density))

    @property
    def coenergy(self) -> float:
        """``int J A`` less the energy, in J per metre or J."""
        return self.integral(self.current_density * self._scaled(self.potential)) - self.energy

    def _pull(self, body: Sequence[str]) -> tuple[Any, Any]:
        """Minus Maxwell's stress tensor times the gradient of a harmonic weight, 1 on the body and 0 elsewhere."""
        ng, weight = self.ng, self.ng.GridFunction(self.weights)
        weight.Set(1.0, definedon=self.mesh.Materials("|".join(body)))
        solid = "|".join(name for name, given in self.problem.materials.items() if not _is_air(given))
        coils = "|".join(["none", *self.problem.ampere_turns])
        held = self.weights.GetDofs(self.mesh.Materials(solid)) | self.weights.GetDofs(self.mesh.Materials(coils))
        free = self.weights.FreeDofs() & ~held
        u, v = self.weights.TnT()
        form = ng.BilinearForm(ng.grad(u) * ng.grad(v) * ng.dx).Assemble()
        residual = (form.mat * weight.vec).Evaluate()
        weight.vec.data -= form.mat.Inverse(free) * residual
        b, slope = self.flux_density, ng.grad(weight)
        pressure = 0.5 * ng.InnerProduct(b, b)
        pull = (pressure * slope - ng.InnerProduct(b, slope) * b) / VACUUM_PERMEABILITY
        # Outside of the air the weight is constant.
        return pull[0], pull[1]

    def force(self, body: Sequence[str]) -> np.ndarray:
        """(2,) in N per metre; axisymmetric of the second component in N."""
        return np.array([self.integral(part) for part in self._pull(body)])

    def torque(self, body: Sequence[str]) -> float:
        """About the origin, in N m per metre."""
        right, up = self._pull(body)
        return self.integral(self.ng.x * up - self.ng.y * right)

    def potential_at(self, x: np.ndarray) -> np.ndarray:
        """A at points (2, n), planar."""
        return np.array([self.potential(self.mesh(*point)) for point in x.T])


def netgen_mesh(mesh: MeshTri, problem: Magnetostatics) -> Any:
    """The same triangles for NGSolve, with the materials, the boundaries with given potentials, and the pairs."""
    import ngsolve
    from netgen.meshing import Element1D, Element2D, Mesh, MeshPoint, Pnt

    made = Mesh(dim=2)
    points = [made.Add(MeshPoint(Pnt(x, y, 0.0))) for x, y in mesh.p.T]
    (ax, ay), (bx, by), (cx, cy) = mesh.p[:, mesh.t].swapaxes(0, 1)
    clockwise = (bx - ax) * (cy - ay) < (cx - ax) * (by - ay)
    corners = np.where(clockwise, mesh.t[[0, 2, 1]], mesh.t)
    for name in problem.materials:
        region = made.AddRegion(name, dim=2)
        for triangle in corners[:, mesh.subdomains[name]].T:
            made.Add(Element2D(region, [points[node] for node in triangle]))
    for name in [*problem.potential, *sum(problem.antiperiodic, ())]:
        region = made.AddRegion(name, dim=1)
        for side in mesh.facets[:, mesh.boundaries[name]].T:
            made.Add(Element1D([points[node] for node in side], index=region))
    for one, other in _images(mesh, problem):
        made.AddPointIdentification(points[one], points[other], identnr=1, type=2)
    return ngsolve.Mesh(made)


def _images(mesh: MeshTri, problem: Magnetostatics) -> np.ndarray:
    """Pairs of nodes that are one, (npairs, 2); every side of a pair is a ray from the origin."""
    found = [np.stack([_outwards(mesh, name) for name in pair], axis=1) for pair in problem.antiperiodic]
    return np.concatenate([np.empty((0, 2), dtype=int), *found])


def _outwards(mesh: MeshTri, name: str) -> np.ndarray:
    """The nodes of a boundary by their distance from the origin."""
    nodes = np.unique(mesh.facets[:, mesh.boundaries[name]])
    return nodes[np.argsort(np.hypot(*mesh.p[:, nodes]))]


def _is_air(given: Material) -> bool:
    return given == Material()


def c_core(iron: Material, name: str) -> Device:
    """The C-core of the examples, and the flux in its gap in Wb/m."""
    materials = {"iron": iron, "magnet": Material(1.05, remanence=(0.0, 1.2)), "air": Material()}
    return Device(
        name,
        ka.read_mesh(EXAMPLES / "c_core.msh", scale=1e-3),
        Magnetostatics(materials, potential={"outer": 0.0}, order=1),
        "flux in the gap (Wb/m)",
        lambda solution: float(np.diff(solution.potential_at(GAP))[0]),
        lambda oracle: float(np.diff(oracle.potential_at(GAP))[0]),
    )


def motor() -> Device:
    """The motor of the examples, and the torque of a pole."""
    example, body = runpy.run_path(str(EXAMPLES / "motor.py")), ["rotor", "magnet"]
    return Device(
        "motor",
        ka.read_mesh(EXAMPLES / "motor.msh", scale=1e-3),
        example["sector"](example["materials"]()),
        "torque (N m/m)",
        lambda solution: solution.torque(body),
        lambda oracle: oracle.torque(body),
        {"periodic": [("left", "right")], "layers": {"gap": 2}},
    )


def actuator() -> Device:
    """The actuator of the examples at its smallest gap, and the force on its plunger."""
    return Device(
        "actuator",
        ka.read_mesh(EXAMPLES / "actuator_1.msh", scale=1e-3),
        replace(runpy.run_path(str(EXAMPLES / "actuator.py"))["PROBLEM"], order=1),
        "force (N)",
        lambda solution: float(solution.force("plunger")[1]),
        lambda oracle: float(oracle.force(["plunger"])[1]),
    )


def devices() -> list[Device]:
    """All that are compared."""
    return [c_core(LINEAR, "C-core"), c_core(SATURATING, "C-core, saturating"), motor(), actuator()]


def compared(device: Device, seed: int = 0) -> list[list[str | float]]:
    """Rows of energy, co-energy and output: this package, NGSolve, their difference and what it should be, in %.

    Co-energies should differ by half the square of the estimate, to first order, and energies by about as much; outputs
    at most by the share of the estimate in the energy norm.
    """
    result = ka.adapt(device.mesh, device.problem, seed=seed, **device.options)
    solution, oracle = result.solution, Oracle(result.mesh, device.problem)
    missing = 0.5 * result.estimate**2
    share = result.estimate / device.problem.energy_norm(result.mesh, solution)
    values = [
        ("energy", solution.energy, oracle.energy, missing / abs(oracle.energy)),
        ("co-energy", solution.coenergy, oracle.coenergy, missing / abs(oracle.coenergy)),
        (device.output, device.ours(solution), device.theirs(oracle), share),
    ]
    return [
        [f"{device.name}, {name}", ours, theirs, 100 * (ours / theirs - 1), 100 * expected]
        for name, ours, theirs, expected in values
    ]


def report(seeds: Sequence[int], quick: bool) -> str:
    """Every device on its adapted mesh, by this package in P1 and by NGSolve in P3 elements."""
    try:
        import ngsolve  # noqa: F401
    except ImportError as error:
        return f"oracle: NGSolve cannot be imported ({error}); install the extra 'bench'."
    chosen = devices()[:1] if quick else devices()
    rows = [row for device in chosen for row in compared(device, seeds[0])]
    return aligned(["oracle", "P1, adapted", "NGSolve, P3", "difference %", "expected %"], rows)
