"""Model a round magnet in a round hole of iron, concentric or not: exact field, meshes, errors in the true domain.

The magnet, of radius R about (d, 0) and magnetised along y, is in a disk of air of radius 1 with A = 0 around it. With
permeability 1 its potential is that in free space, ``A = -(x - d) / 2`` inside and ``-R^2 / 2 Re 1 / (z - d)`` outside
with z = x + i y, and what its image adds, ``R^2 / 2 Re z / (1 - d z)``: on |z| = 1 both are one another's negative.
Concentric, permeabilities of all sizes have a x inside and (b + c / r^2) x outside.
"""

from dataclasses import dataclass

import numpy as np
from skfem import Basis, ElementTriP1, ElementTriP2, ElementTriP3, InteriorFacetBasis, MeshTri, MeshTri2

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Field, Magnetostatics, Material

ELEMENTS = {1: ElementTriP1, 2: ElementTriP2, 3: ElementTriP3}
VACUUM_PERMEABILITY = 4e-7 * np.pi
POINTS = 8  # degree of the rule that errors are integrated by


@dataclass(frozen=True)
class RoundMagnet:
    """A magnet; `shift` is where the disk is moved to by ``z -> (z + shift) / (1 + shift z)``, which keeps circles."""

    shift: float = 0.0
    permeability: float = 1.0

    @property
    def place(self) -> tuple[float, float]:
        """Centre d and radius R: of a magnet of 2/5 of the air's radius, moved."""
        a, r = self.shift, 0.4
        return a * (1 - r**2) / (1 - (a * r) ** 2), r * (1 - a**2) / (1 - (a * r) ** 2)

    def mesh(self, rings: int, curved: bool) -> MeshTri:
        """Nodes on rings, two fifths of them in the magnet; curved sides on both circles on request."""
        plain, ring = disk(rings)
        z = np.exp(0.1j) * (plain.p[0] + 1j * plain.p[1])
        z = (z + self.shift) / (1 + self.shift * z)
        magnet, ends = round(0.4 * rings), ring[plain.facets]
        inside = ring[plain.t].max(axis=0) <= magnet
        names = {"magnet": np.flatnonzero(inside), "air": np.flatnonzero(~inside)}
        mesh = MeshTri(np.stack((z.real, z.imag)), plain.t).with_subdomains(names)
        circles = {name: np.flatnonzero(np.all(ends == k, axis=0)) for name, k in (("rim", magnet), ("outer", rings))}
        mesh = mesh.with_boundaries(circles)
        if not curved:
            return mesh
        bent = MeshTri2.from_mesh(mesh)
        for name, arc in self.curves.items():
            middles, centre = mesh.p.shape[1] + circles[name], np.reshape(arc.centre, (2, 1))
            way = bent.doflocs[:, middles] - centre
            bent.doflocs[:, middles] = centre + arc.radius * way / np.hypot(*way)
        return bent.with_subdomains(names).with_boundaries(circles)

    @property
    def curves(self) -> dict[str, ka.Arc]:
        """The circles, of which coarse meshes have too few facets to tell."""
        centre, radius = self.place
        return {"rim": ka.Arc((centre, 0.0), radius), "outer": ka.Arc((0.0, 0.0), 1.0)}

    def problem(self, order: int, curved: bool = True) -> Magnetostatics:
        """What is to be solved."""
        magnet = Material(self.permeability, remanence=(0.0, self.permeability))
        return Magnetostatics({"magnet": magnet, "air": Material()}, {"outer": 0.0}, order=order, curved=curved)

    def gradient(self, x: np.ndarray, inside: np.ndarray) -> np.ndarray:
        """Of the exact potential, (2, ...), with the magnet's where it is `inside`."""
        (d, radius), z = self.place, x[0] + 1j * x[1]
        far = np.where(inside, d + radius, z)  # of the magnet's own field outside
        if self.shift == 0.0:
            nu = 1 / self.permeability
            rows = [[radius, -radius, -1 / radius], [0.0, 1.0, 1.0], [nu, -1.0, 1 / radius**2]]
            a, b, c = np.linalg.solve(rows, [0.0, 0.0, -1.0])
            slope = np.where(inside, a, b - c / far**2)
        else:
            slope = np.where(inside, -0.5, 0.5 * radius**2 / (far - d) ** 2) + 0.5 * radius**2 / (1 - d * z) ** 2
        return np.stack((slope.real, -slope.imag))

    def norm(self) -> float:
        """``a(A, A) = -int_magnet nu dA/dx`` of the exact potential, nu relative: dA/dx is harmonic in the magnet."""
        d, radius = self.place
        slope = self.gradient(np.array([[d], [0.0]]), np.array([True]))
        return float(-np.pi * radius**2 * slope[0, 0])

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
        (centre, radius), around = self.place, np.flatnonzero((other >= 0) & (magnet[one] != magnet[other]))
        sides = [InteriorFacetBasis(mesh, ELEMENTS[order](), facets=around, side=k, intorder=0) for k in (0, 1)]
        found = [np.asarray(side.interpolate(values).grad)[:, :, 0] for side in sides]
        outside = np.where(magnet[one[around]], found[1], found[0])
        at, size = slivers(mesh, around, centre, radius)
        beside = [np.sum((self.gradient(at, np.array(within)) - outside) ** 2, axis=0) for within in (True, False)]
        added = float(np.sum(size * (beside[0] / self.permeability - beside[1])))
        at, size = slivers(mesh, mesh.boundary_facets(), 0.0, 1.0)
        return added + float(np.sum(size * np.sum(self.gradient(at, np.array(False)) ** 2, axis=0)))


def slivers(mesh: MeshTri, facets: np.ndarray, centre: float, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """The middles of arcs, (2, f), and the areas between them and their chords, (f,)."""
    start, end = mesh.p[:, mesh.facets[:, facets]].swapaxes(0, 1)
    way = 0.5 * (start + end) - [[centre], [0.0]]
    angle = 2 * np.arcsin(np.hypot(*(end - start)) / (2 * radius))
    return [[centre], [0.0]] + radius * way / np.hypot(*way), 0.5 * radius**2 * (angle - np.sin(angle))


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
