"""Random blocks of iron and magnets in applied fields that are known in closed form."""

import numpy as np
from scipy.special import ellipe, ellipk
from skfem import MeshTet

from helpers.magnet_solids import blocks
from kohonen_adapt.magnetostatics import Froehlich, MagneticScalarPotential, Material

PARTS = {"iron": ((-0.5, -0.5, -0.5), (0.5, 0.0, 0.5)), "block": ((-0.5, 0.5, -0.5), (0.0, 1.0, 0.5))}
STEEL = Froehlich(2000.0, 1.9)


def block_mesh(seed, cells=8):
    """Two blocks in a box of air, with nodes off their planes moved at random; `cells` along x, a multiple of 4."""
    rng, t = np.random.default_rng(seed), np.linspace(-1.0, 1.0, cells + 1)
    mesh = blocks([t, np.linspace(-1.5, 1.5, 3 * cells // 2 + 1), t], PARTS)
    p = mesh.p.copy()
    on = np.abs(p[:, :, None] - np.array([-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5])).min(axis=2) < 1e-9
    p += np.where(on, 0.0, rng.uniform(-0.5, 0.5, p.shape) / cells)
    return MeshTet(p, mesh.t, _boundaries=mesh.boundaries, _subdomains=mesh.subdomains)


def uniform(vector):
    return lambda x: np.tile(np.asarray(vector, dtype=float)[:, None], x.shape[1])


def dipole(moment, at):
    """H of a dipole moment in A m^2 at a point."""
    moment, at = np.asarray(moment, dtype=float)[:, None], np.asarray(at, dtype=float)[:, None]

    def field(x):
        d = x - at
        r = np.linalg.norm(d, axis=0)
        return (3.0 * d * np.sum(moment * d, axis=0) / r**2 - moment) / (4.0 * np.pi * r**3)

    return field


def loop(current, radius, at):
    """H of a circular loop around the direction z, by elliptic integrals."""

    def field(x):
        px, py, z = x - np.asarray(at, dtype=float)[:, None]
        rho = np.maximum(np.hypot(px, py), 1e-9 * radius)
        far, near = (radius + rho) ** 2 + z**2, (radius - rho) ** 2 + z**2
        m, scale = 4.0 * radius * rho / far, current / (2.0 * np.pi * np.sqrt(far))
        k, e = ellipk(m), ellipe(m)
        along = scale * (k + (radius**2 - rho**2 - z**2) / near * e)
        outward = scale * z / rho * ((radius**2 + rho**2 + z**2) / near * e - k)
        return np.stack([outward * px / rho, outward * py / rho, along])

    return field


def random_problem(seed):
    """Materials, an applied field and conditions drawn at random."""
    rng = np.random.default_rng(seed)
    strength = 10.0 ** rng.uniform(2.0, 5.5)
    applied = [
        uniform(strength * rng.normal(size=3)),
        dipole(strength * rng.normal(size=3), (0.2, 0.9, 1.3)),
        loop(strength, 0.8, (0.1, 0.3, 1.2)),
        loop(strength, 0.31, (0.37, 0.71, 0.013)),  # in the air beside both blocks
    ][rng.integers(4)]
    law, remanence = (None, STEEL)[rng.integers(2)], tuple(rng.normal(size=3))
    iron = Material(1000.0) if law is None else Material(bh=law)
    block = [
        Material(1.05, remanence=remanence),
        Material(1.0, remanence=remanence),
        Material(50.0),
        Material(bh=STEEL, coercivity=tuple(1e4 * rng.normal(size=3))),
    ][rng.integers(4)]
    potential = [{}, {"outer": 0.0}, {"z-": 0.0}, {"z-": 0.0, "z+": 0.0}][rng.integers(4)]
    return MagneticScalarPotential({"iron": iron, "block": block, "air": Material()}, potential, applied_field=applied)
