"""Model a round magnet in a round hole of iron: exact field, meshes, errors in the true domain.

The magnet, of radius R and magnetised along y, is in a disk of air of radius 1 with A = 0 around it. The potential is
a x inside and (b + c / r^2) x outside.
"""

from dataclasses import dataclass

import numpy as np
from skfem import Basis, ElementTriP1, ElementTriP2, ElementTriP3, InteriorFacetBasis, MeshTri, MeshTri2

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Field, Magnetostatics, Material

ELEMENTS = {1: ElementTriP1, 2: ElementTriP2, 3: ElementTriP3}
VACUUM_PERMEABILITY = 4e-7 * np.pi
POINTS = 8  # degree of the rule that errors are integrated by
RADIUS = 0.4
CIRCLES = {"rim": RADIUS, "outer": 1.0}
CURVES = {name: ka.Arc((0.0, 0.0), radius) for name, radius in CIRCLES.items()}  # coarse meshes have too few facets


@dataclass(frozen=True)
class RoundMagnet:
    permeability: float = 1.0

    def mesh(self, rings: int, curved: bool) -> MeshTri:
        """Nodes on rings, two fifths of them in the magnet; curved sides on both circles on request."""
        plain, ring = disk(rings)
        z = np.exp(0.1j) * (plain.p[0] + 1j * plain.p[1])
        inside = ring[plain.t].max(axis=0) <= round(RADIUS * rings)
        names = {"magnet": np.flatnonzero(inside), "air": np.flatnonzero(~inside)}
        mesh = MeshTri(np.stack((z.real, z.imag)), plain.t).with_subdomains(names)
        circles = {
            name: np.flatnonzero(np.all(ring[plain.facets] == round(radius * rings), axis=0))
            for name, radius in CIRCLES.items()
        }
        mesh = mesh.with_boundaries(circles)
        if not curved:
            return mesh
        bent = MeshTri2.from_mesh(mesh)
        for name, radius in CIRCLES.items():
            middles = mesh.p.shape[1] + circles[name]
            bent.doflocs[:, middles] *= radius / np.hypot(*bent.doflocs[:, middles])
        return bent.with_subdomains(names).with_boundaries(circles)

    def problem(self, order: int, curved: bool = True) -> Magnetostatics:
        """What is to be solved."""
        magnet = Material(self.permeability, remanence=(0.0, self.permeability))
        return Magnetostatics({"magnet": magnet, "air": Material()}, {"outer": 0.0}, order=order, curved=curved)

    def gradient(self, x: np.ndarray, inside: np.ndarray) -> np.ndarray:
        """Of the exact potential, (2, ...), with the magnet's where it is `inside`."""
        far = np.where(inside, RADIUS, x[0] + 1j * x[1])  # of the magnet's own field outside
        nu = 1 / self.permeability
        rows = [[RADIUS, -RADIUS, -1 / RADIUS], [0.0, 1.0, 1.0], [nu, -1.0, 1 / RADIUS**2]]
        a, b, c = np.linalg.solve(rows, [0.0, 0.0, -1.0])
        slope = np.where(inside, a, b - c / far**2)
        return np.stack((slope.real, -slope.imag))

    def norm(self) -> float:
        """``a(A, A) = -int_magnet nu dA/dx`` of the exact potential, nu relative: dA/dx is harmonic in the magnet."""
        return float(-np.pi * RADIUS**2 * self.gradient(np.zeros((2, 1)), np.array([True]))[0, 0])

    def error(self, field: Field, order: int) -> float:
        """Of a solution, in % of the energy norm, in the true domain, of which chords leave out slivers."""
        mesh, values = field.mesh, field.potential if order == 1 else field.values
        basis = Basis(mesh, ELEMENTS[order](), intorder=POINTS)
        inside = np.isin(np.arange(mesh.t.shape[1]), mesh.subdomains["magnet"])[:, None]
        off = np.asarray(basis.interpolate(values).grad) - self.gradient(np.asarray(basis.global_coordinates()), inside)
        nu = np.where(inside, 1 / self.permeability, 1.0)
        squared = float(np.sum(nu * np.sum(off**2, axis=0) * basis.dx))
        if not isinstance(mesh, MeshTri2):
            squared += self.cut_off(mesh, values, order)
        return 100 * float(np.sqrt(squared / self.norm()))

    def lacking(self, field: Field) -> float:
        """The same of a solution on curved sides by what ``a(A, A)`` lacks, which its energy tells."""
        found = field.squared_norm * VACUUM_PERMEABILITY
        return 100 * float(np.sqrt(max(0.0, 1 - found / self.norm())))

    def cut_off(self, mesh: MeshTri, values: np.ndarray, order: int) -> float:
        """What the slivers between chords and arcs add to the squared error, of an area of ``R^2 (t - sin t) / 2``.

        Beside the magnet the solution goes on from outside of it, where there is no air it is 0.
        """
        one, other = mesh.f2t
        magnet = np.isin(np.arange(mesh.t.shape[1]), mesh.subdomains["magnet"])
        around = np.flatnonzero((other >= 0) & (magnet[one] != magnet[other]))
        sides = [InteriorFacetBasis(mesh, ELEMENTS[order](), facets=around, side=k, intorder=0) for k in (0, 1)]
        found = [np.asarray(side.interpolate(values).grad)[:, :, 0] for side in sides]
        outside = np.where(magnet[one[around]], found[1], found[0])
        at, size = slivers(mesh, around, RADIUS)
        beside = [np.sum((self.gradient(at, np.array(within)) - outside) ** 2, axis=0) for within in (True, False)]
        added = float(np.sum(size * (beside[0] / self.permeability - beside[1])))
        at, size = slivers(mesh, mesh.boundary_facets(), 1.0)
        return added + float(np.sum(size * np.sum(self.gradient(at, np.array(False)) ** 2, axis=0)))


def slivers(mesh: MeshTri, facets: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """The middles of arcs, (2, f), and the areas between them and their chords, (f,)."""
    start, end = mesh.p[:, mesh.facets[:, facets]].swapaxes(0, 1)
    way = 0.5 * (start + end)
    angle = 2 * np.arcsin(np.hypot(*(end - start)) / (2 * radius))
    return radius * way / np.hypot(*way), 0.5 * radius**2 * (angle - np.sin(angle))


def disk(rings: int) -> tuple[MeshTri, np.ndarray]:
    """A disk of radius 1 with 6 k nodes on the k-th of its circles, and the number of that of every node."""
    first = np.cumsum([0, 1, *(6 * k for k in range(1, rings + 1))])
    points, elements = [np.zeros((2, 1))], []
    for k in range(1, rings + 1):
        angle = 2 * np.pi * np.arange(6 * k) / (6 * k)
        points.append(k / rings * np.stack((np.cos(angle), np.sin(angle))))
        side, step = np.divmod(np.arange(6 * k), k)
        out, follower = first[k] + np.arange(6 * k), first[k] + np.arange(1, 6 * k + 1) % (6 * k)
        inside, after = (first[k - 1] + (side * (k - 1) + step + more) % max(6 * (k - 1), 1) for more in (0, 1))
        more = step < k - 1
        elements += [(out, follower, inside), (inside[more], after[more], follower[more])]
    mesh = MeshTri(np.hstack(points), np.hstack([np.stack(part) for part in elements]))
    return mesh, np.repeat(np.arange(rings + 1), np.diff(first))
