"""Magnetic devices as a mesh and the problem on it: coils, a plunger, a machine, magnets, a wire in a tube."""

from itertools import pairwise

import numpy as np
from skfem import MeshTri

from helpers import meshes
from helpers.sheets import MU0, quadrupole_potential, rectangle_potential
from helpers.tensor_meshes import box, disk, equal_rings, sector
from kohonen_adapt.magnetostatics import Brauer, Magnetostatics, Material

AIR, STEEL = Material(), Material(bh=Brauer(100.0, 10.0, 1.8))
INCH = 0.0254
MM = 1e-3
MAGNET_HALF = (0.005, 0.0025)
PLACES = {"a": (-0.0075, -0.0025), "b": (0.0075, 0.0025)}
STATOR_PLACE = (0.0025, 0.005)
BRAUER = Brauer(100.0, 10.0, 1.8)
WIRE, BORE, RIM, OUTER, CURRENT = 0.005, 0.01, 0.03, 0.05, 2000.0
TURNS = 5e4  # A in a coil side of the actuator
CIRCUIT = {"go": 50, "back": -50}
PITCH = np.pi / 2


def graded(step, growth, end, *knots):
    """Places from the first knot on, `step` apart up to the last, then farther and farther."""
    near = [np.linspace(a, b, round((b - a) / step) + 1)[:-1] for a, b in pairwise(knots)]
    far = [0.0]
    while far[-1] < end - knots[-1]:
        far.append(far[-1] + step * growth ** len(far))
    return np.concatenate([*near, knots[-1] + np.array(far) * (end - knots[-1]) / far[-1]])


def coil(estimator="residual", order=1):
    return Magnetostatics(
        {"coil": Material(), "air": Material()},
        potential={"far": 0.0},
        ampere_turns={"coil": 1000.0},  # 1 A
        axisymmetric=True,
        estimator=estimator,
        order=order,
    )


def coil_mesh(fineness, end):
    """FEMM's tutorial: a coil of 1 and 3 inches in diameter and 2 inches in length; air to `end` in metres."""
    step, growth = INCH / (8 * fineness), 1.25 ** (1 / fineness)
    z = graded(step, growth, end, 0.0, INCH)
    mesh = MeshTri.init_tensor(graded(step, growth, end, 0.0, 0.5 * INCH, 1.5 * INCH), np.append(-z[:0:-1], z))

    def in_coil(x):
        return (x[0] > 0.5 * INCH) & (x[0] < 1.5 * INCH) & (np.abs(x[1]) < INCH)

    mesh = mesh.with_boundaries({"far": lambda x: (x[0] > 0.999 * end) | (np.abs(x[1]) > 0.999 * end)})
    return mesh.with_subdomains({"coil": in_coil, "air": lambda x: ~in_coil(x)})


def rings_mesh(parts, end=0.2, step=MM):
    """Squares of 1 mm or another step to 20 mm, wider beyond; `parts`: name to (r0, r1, z0, z1) in mm, the rest air."""
    r = up = graded(step, 1.2, end, 0.0, 0.02)
    mesh = MeshTri.init_tensor(r, np.append(-up[:0:-1], up))
    r, z = mesh.p[:, mesh.t].mean(axis=1) / MM
    inside = {name: (r > a) & (r < b) & (z > c) & (z < d) for name, (a, b, c, d) in parts.items()}
    inside["air"] = ~np.any(list(inside.values()), axis=0)
    mesh = mesh.with_boundaries({"far": lambda x: (x[0] > 0.999 * end) | (np.abs(x[1]) > 0.999 * end)})
    return mesh.with_subdomains({name: np.flatnonzero(mask) for name, mask in inside.items()})


def uniform(degrees):
    """A of 1 T in that direction."""
    a = np.deg2rad(degrees)
    return lambda x: x[1] * np.cos(a) - x[0] * np.sin(a)


def turned_magnet(cells, degrees):
    """A magnet of 10 x 5 mm, 1e6 A/m, in 1 T in that direction. Its image in the square box is along it."""
    ticks = np.linspace(-0.02, 0.02, cells + 1)
    mesh = box(ticks, ticks, {"magnet": (-0.005, 0.005, -0.0025, 0.0025)})
    magnet = Material(remanence=(MU0 * 1e6, 0.0))
    return mesh, Magnetostatics({"magnet": magnet, "air": AIR}, potential={"outer": uniform(degrees)}, order=1)


def stator_magnet(k, degrees):
    """A magnet of 10 x 5 mm off the centre of a stator of two pole pairs, along y."""
    wide, high = MAGNET_HALF
    x, y = STATOR_PLACE
    ticks = np.linspace(-0.02, 0.02, 16 * k + 1)
    mesh = box(ticks, ticks, {"magnet": (x - wide, x + wide, y - high, y + high)})
    magnet = Material(remanence=(0.0, MU0 * 1e6))
    outer = lambda x: rectangle_potential(x, STATOR_PLACE, MAGNET_HALF) + quadrupole_potential(x, degrees)  # noqa: E731
    return mesh, Magnetostatics({"magnet": magnet, "air": AIR}, potential={"outer": outer}, order=1)


def two_magnets(k):
    """Two magnets of 10 x 5 mm side by side, the second 5 mm higher, both along y."""
    wide, high = MAGNET_HALF
    sides = {name: (x - wide, x + wide, y - high, y + high) for name, (x, y) in PLACES.items()}
    mesh = box(np.linspace(-0.025, 0.025, 20 * k + 1), np.linspace(-0.02, 0.02, 16 * k + 1), sides)
    magnet = Material(remanence=(0.0, MU0 * 1e6))
    potential = {"outer": lambda x: sum(rectangle_potential(x, place, MAGNET_HALF) for place in PLACES.values())}
    return mesh, Magnetostatics({"a": magnet, "b": magnet, "air": AIR}, potential=potential, order=1)


def tube(**more):
    materials = {"wire": Material(), "iron": Material(bh=BRAUER), "air": Material()}
    given = {"potential": {"outer": 0.0}, "ampere_turns": {"wire": CURRENT}, "order": 1} | more
    return Magnetostatics(materials, **given)


def wire_mesh(rings):
    """`rings` a multiple of 10, so that the circles of the wire and the iron are among them."""
    mesh = meshes.disk(rings, OUTER).with_boundaries({"outer": lambda x: np.hypot(*x) > 0.99 * OUTER})
    radius = np.hypot(*mesh.p[:, mesh.t].mean(axis=1))
    wire, iron = radius < WIRE, (radius > BORE) & (radius < RIM)
    parts = {"wire": wire, "iron": iron, "air": ~wire & ~iron}
    return mesh.with_subdomains({name: np.flatnonzero(inside) for name, inside in parts.items()})


def actuator(cells=20, **more):
    """A coil of two sides over a bar of steel that it saturates."""
    parts = {"go": (-0.008, -0.004, 0.002, 0.006), "back": (0.002, 0.006, 0.002, 0.006), "bar": (-0.01, 0.01, -8e-3, 0)}
    mesh = box(np.linspace(-0.02, 0.02, cells + 1), np.linspace(-0.02, 0.02, cells + 1), parts)
    given = {
        "potential": {"outer": 0.0},
        "ampere_turns": {"go": TURNS, "back": -TURNS},
        "depth": 0.03,
        "order": 1,
    } | more
    return mesh, Magnetostatics({"go": AIR, "back": AIR, "bar": STEEL, "air": AIR}, **given)


def plunger(step=MM):
    """The same around an axis: a coil and a plunger of steel."""
    mesh = rings_mesh({"coil": (8, 12, -4, 4), "plunger": (0, 5, 2, 14)}, step=step)
    parts = {"coil": AIR, "plunger": STEEL, "air": AIR}
    return mesh, Magnetostatics(parts, {"far": 0.0}, ampere_turns={"coil": TURNS}, axisymmetric=True, order=1)


def machine(across=41, around=31):
    """A pole of a machine, its sides antiperiodic, of so many nodes across and around."""
    parts = {"coil": (0.02, 0.03, 0.35, 0.85), "hub": (0.01, 0.02, 0, PITCH), "tooth": (0.035, 0.045, 0.1, 0.5)}
    mesh = sector(np.linspace(0.01, 0.05, across), np.linspace(0.0, PITCH, around), parts)
    materials = {"coil": Material(current_density=6e8), "hub": STEEL, "tooth": STEEL, "air": AIR}
    return mesh, Magnetostatics(materials, {"outer": 0.0, "bore": 0.0}, antiperiodic=[("right", "left")], order=1)


def shielded():
    """Two wires beside one another in a tube of steel, with an open boundary."""
    mesh = disk(equal_rings(20, 0.04), {"inside": 8, "tube": 12, "air": 20})
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    places = {name: np.hypot(x - at, y) < 0.005 for name, at in (("go", -0.008), ("back", 0.008))}
    rest = np.setdiff1d(mesh.subdomains["inside"], np.flatnonzero(places["go"] | places["back"]))
    parts = {name: np.flatnonzero(there) for name, there in places.items()} | {"inside": rest}
    mesh = mesh.with_subdomains(mesh.subdomains | parts)
    materials = dict.fromkeys(("go", "back", "inside", "air"), AIR) | {"tube": STEEL}
    return mesh, Magnetostatics(materials, ampere_turns={"go": TURNS, "back": -TURNS}, open_boundary="outer", order=1)
