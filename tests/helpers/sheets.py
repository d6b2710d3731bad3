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


def rectangle_force(centre, other, half, magnetisation=1e6):
    """Force in N/m on one rectangle by an equal one: J x B of the other's field over its own sheets."""

    def pull(component, side, height):
        field = rectangle_field(np.array([[centre[0] + side], [centre[1] + height]]), other, half, magnetisation)
        return -np.sign(side) * magnetisation * (-field[1, 0], field[0, 0])[component]

    return np.array(
        [
            sum(quad(lambda h, i=i, s=s: pull(i, s, h), -half[1], half[1])[0] for s in (-half[0], half[0]))
            for i in range(2)
        ]
    )


def line_potential(x, at, current):
    """A of a line current, zero at 1 m from it."""
    return -MU0 * current / (2 * np.pi) * np.log(np.hypot(x[0] - at[0], x[1] - at[1]))
