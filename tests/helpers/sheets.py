"""Exact fields of rectangle magnets and of line currents in free space, (2, n) in m to T and Wb/m."""

import numpy as np
from scipy.integrate import quad

MU0 = 4e-7 * np.pi


def rectangle_field(x, centre, half, magnetisation=1e6):
    """Flux density of M along y in a rectangle: a current sheet at its left and right side, by complex logarithms.

    A line current I at z0 has By + i Bx = mu0 I / (2 pi (z - z0)); this is its integral over each sheet of -+M.
    """
    z = x[0] - centre[0] + 1j * (x[1] - centre[1])
    sheets = [1j * np.log((z - side - 1j * half[1]) / (z - side + 1j * half[1])) for side in (-half[0], half[0])]
    field = MU0 * magnetisation / (2 * np.pi) * (sheets[0] - sheets[1])
    return np.stack((field.imag, field.real))


def rectangle_potential(x, centre, half, magnetisation=1e6):
    """A of the same sheets: the integral of -mu0 I / (2 pi) ln r."""

    def primitive(across, along):
        return 0.5 * along * np.log(across**2 + along**2) - along + np.abs(across) * np.arctan2(along, np.abs(across))

    right, up = x[0] - centre[0], x[1] - centre[1]
    left, right = (
        primitive(right - side, up + half[1]) - primitive(right - side, up - half[1]) for side in (-half[0], half[0])
    )
    return -MU0 * magnetisation / (2 * np.pi) * (left - right)


def pull(field, centre, half, magnetisation=1e6):
    """Force (2,) in N/m and torque about the origin in N m/m on a rectangle in a field: J x B over its own sheets."""

    def density(side, height):
        x = np.array([centre[0] + side, centre[1] + height])
        right, up = field(x[:, None])[:, 0]
        force = -np.sign(side) * magnetisation * np.array([-up, right])
        return *force, x[0] * force[1] - x[1] * force[0]

    found = np.array(
        [
            sum(quad(lambda h, i=i, s=s: density(s, h)[i], -half[1], half[1])[0] for s in (-half[0], half[0]))
            for i in range(3)
        ]
    )
    return found[:2], found[2]


def rectangle_force(centre, other, half, magnetisation=1e6):
    """Force in N/m on one rectangle by an equal one."""
    return pull(lambda x: rectangle_field(x, other, half, magnetisation), centre, half, magnetisation)[0]


def quadrupole_potential(x, degrees, strength=25.0):
    """A inside a stator whose current sheet goes with cos(2 phi - angle): that times r^2 / 2 times T/m."""
    turned = (x[0] + 1j * x[1]) ** 2 * np.exp(-1j * np.deg2rad(degrees))
    return 0.5 * strength * turned.real


def quadrupole_field(x, degrees, strength=25.0):
    """Its flux density (dA/dy, -dA/dx)."""
    slope = strength * (x[0] + 1j * x[1]) * np.exp(-1j * np.deg2rad(degrees))
    return np.stack((-slope.imag, -slope.real))


def line_potential(x, at, current):
    """A of a line current, zero at 1 m from it."""
    return -MU0 * current / (2 * np.pi) * np.log(np.hypot(x[0] - at[0], x[1] - at[1]))
