"""Random magnets of nonlinear material, on coarse meshes of one kind of element each."""

from dataclasses import dataclass

import numpy as np
from skfem import Basis, ElementTriP1, ElementTriP2, ElementTriP3, MeshTri, MeshTri2

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Arctan, Brauer, Froehlich, Magnetostatics, Material
from kohonen_adapt.mesh.curved import refined

KINDS = {1: ElementTriP1, 2: ElementTriP2, 3: ElementTriP3}
CURVE = ((0.0, 0.0), (0.2, 60.0), (0.6, 110.0), (1.0, 190.0), (1.4, 600.0), (1.6, 2.5e3), (1.8, 9e3), (2.3, 1.5e5))
FINE = 16  # degree that stands for exact integration


@dataclass(frozen=True)
class Steel:
    """A start mesh of the unit square, a problem on it and what kind it is."""

    kind: str
    mesh: MeshTri
    problem: Magnetostatics


@dataclass(frozen=True)
class Fall:
    """The functional of a solution as used and by degree `FINE`, and that of the solution on the refined mesh."""

    used: float
    fine: float
    refined: float

    @property
    def rises(self) -> bool:
        """Return True if the functional is higher on the refined mesh."""
        return self.refined > self.used

    @property
    def misjudged(self) -> float:
        """Return what quadrature adds to the functional over what refinement takes off."""
        return abs(self.used - self.fine) / abs(self.used - self.refined)


def random_steel(seed: int) -> Steel:
    """Return a problem of steel, a coil and air, with given values that are linear on the outer boundary.

    Around an axis the square begins off it: functions of elements at the axis have a factor that refined ones beside
    it have not, so that the spaces are not nested there.
    """
    rng = np.random.default_rng(seed)
    order, around = int(rng.integers(1, 4)), bool(rng.integers(2))
    curved = order > 1 and bool(rng.integers(2))
    mesh = _mesh(rng, rng.uniform(0.1, 1.0) if around else 0.0, curved)
    law = _law(rng, int(rng.integers(4)))
    a, b, c = rng.uniform(-1.0, 1.0, 3) * rng.uniform(0.3, 2.5)
    materials = {
        "steel": Material(bh=law),
        "coil": Material(current_density=10.0 ** rng.uniform(5.0, 7.0)),
        "air": Material(),
    }
    outer = {"outer": lambda x: (a + b * x[0] + c * x[1]) / (x[0] if around else 1.0)}
    kind = f"order {order}{', curved' if curved else ''}{', axis' if around else ''}"
    return Steel(kind, mesh, Magnetostatics(materials, outer, axisymmetric=around, order=order))


def _mesh(rng: np.random.Generator, left: float, curved: bool) -> MeshTri:
    """Return 3 to 5 squares a side, halved, their inner nodes moved at random and their inner sides curved."""
    number = int(rng.integers(3, 6))
    mesh = MeshTri.init_tensor(left + np.linspace(0.0, 1.0, number + 1), np.linspace(0.0, 1.0, number + 1))
    inner, p = mesh.interior_nodes(), mesh.p.copy()
    p[:, inner] += rng.uniform(-0.12, 0.12, (2, inner.size)) / number
    mesh = MeshTri(p, mesh.t)
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    steel, low = x - left < rng.uniform(0.3, 0.8), y < 0.5
    parts = {"steel": steel, "coil": ~steel & low, "air": ~steel & ~low}
    if curved:
        bent, inside = MeshTri2.from_mesh(mesh).p.copy(), np.flatnonzero(mesh.f2t[1] >= 0)
        bent[:, mesh.nvertices + inside] += rng.uniform(-0.025, 0.025, (2, inside.size)) / number
        mesh = MeshTri2(bent, mesh.t)
    mesh = mesh.with_subdomains({name: np.flatnonzero(own) for name, own in parts.items()})
    return mesh.with_boundaries({"outer": lambda x: np.ones(x.shape[1], dtype=bool)})


def _law(rng: np.random.Generator, kind: int) -> Froehlich | Brauer | Arctan | np.ndarray:
    if kind == 0:
        return Froehlich(10.0 ** rng.uniform(2.5, 4.0), rng.uniform(0.8, 2.0))
    if kind == 1:
        return Brauer(100.0 * rng.uniform(0.5, 2.0), 5.0 * rng.uniform(0.5, 2.0), 2.0 * rng.uniform(0.5, 1.2))
    return Arctan(10.0 ** rng.uniform(2.5, 4.0), rng.uniform(1.0, 2.0)) if kind == 2 else np.array(CURVE)


def fall_of(problem: Magnetostatics, mesh: MeshTri) -> Fall:
    """Return the functional on a mesh and on the mesh with every element cut in four."""
    first, second = (problem.solve(each) for each in (mesh, divided(mesh)))
    fine = by_degree(mesh, problem.ritz(mesh, first))
    return Fall(first.newton[-1].functional, fine, second.newton[-1].functional)


def divided(mesh: MeshTri) -> MeshTri:
    """Return the mesh with every element cut in four, curved ones as images of the parts of the reference element."""
    if not isinstance(mesh, MeshTri2):
        return mesh.refined()
    return refined(mesh).with_boundaries({"outer": lambda x: np.ones(x.shape[1], dtype=bool)})


def by_degree(mesh: MeshTri, ritz: ka.Ritz, degree: int = FINE) -> float:
    """Return a functional, in the plane or off the axis that it is around, by scikit-fem's quadrature."""
    basis = Basis(mesh, KINDS[ritz.order](), intorder=degree)
    function = basis.interpolate(np.asarray(ritz.values))
    slope, radius = np.asarray(function.grad), np.ones_like(basis.dx)
    if ritz.axisymmetric:
        radius = np.asarray(basis.global_coordinates())[0]
    number, count = np.asarray(ritz.region), len(ritz.laws)
    coefficient, source = (np.broadcast_to(each, count)[number][:, None] for each in (ritz.coefficient, ritz.source))
    flux = np.broadcast_to(np.reshape(np.asarray(ritz.flux), (2, -1)) if np.ndim(ritz.flux) else 0.0, (2, count))
    density = 0.5 * coefficient * np.sum(slope**2, axis=0) / radius
    for k, law in enumerate(ritz.laws):
        if law is not None:
            rows = number == k
            density[rows] = radius[rows] * law.energy(np.hypot(*slope[:, rows]) / radius[rows])
    density -= source * np.asarray(function) + np.sum(flux[:, number][:, :, None] * slope, axis=0)
    return float(np.sum(density * basis.dx))
