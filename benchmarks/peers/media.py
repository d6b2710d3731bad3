"""Materials of a problem at points, for solvers that integrate by points."""

from dataclasses import dataclass

import numpy as np

from kohonen_adapt.magnetostatics import Law, Material

HALVINGS = 100  # of an interval around |B| of a given |H|


@dataclass(frozen=True)
class Medium:
    """A material at some points, ``H = nu(|B|) B - Hc``.

    Attributes
    ----------
    rows : (k,)
        Numbers of the points.
    reluctivity
        In m/H, of linear material.
    law
        B-H law, None for linear material.
    coercivity, remanence : (2, k)
        Hc in A/m, and B at H = 0 in T.
    """

    rows: np.ndarray
    reluctivity: float
    law: Law | None
    coercivity: np.ndarray
    remanence: np.ndarray

    @classmethod
    def of(cls, material: Material, rows: np.ndarray, x: np.ndarray) -> "Medium":
        """Return the medium of a material at the points `rows` of `x` (2, n)."""
        by_field = material.coercivity is not None
        given = material.coercivity if by_field else material.remanence
        vector = given(x[:, rows]) if callable(given) else np.reshape(given, (2, 1))
        vector = np.array(np.broadcast_to(vector, (2, rows.size)), dtype=float)
        size, law, nu = np.hypot(*vector), material.bh, material.reluctivity
        if by_field:
            partner = size / nu if law is None else _inverse(law, size)
        else:
            partner = size * nu if law is None else law.field_strength(size)
        other = vector * np.divide(partner, size, out=np.zeros_like(size), where=size > 0.0)
        coercivity, remanence = (vector, other) if by_field else (other, vector)
        return cls(rows, nu, law, coercivity, remanence)

    def strength(self, b: np.ndarray) -> np.ndarray:
        """Return H in A/m for B (2, k) in T."""
        return self._secant(b) * b - self.coercivity

    def tangent(self, b: np.ndarray) -> np.ndarray:
        """Return ``dH/dB`` as its components xx, xy and yy, shape (3, k)."""
        secant, size = self._secant(b), np.hypot(*b)
        along = b / np.where(size > 0.0, size, 1.0)
        more = np.zeros(size.shape) if self.law is None else self.law.slope(size) - secant
        return np.stack([secant + more * along[0] ** 2, more * along[0] * along[1], secant + more * along[1] ** 2])

    def energy(self, b: np.ndarray) -> np.ndarray:
        """Return ``int H . dB`` from the remanent state in J/m^3."""
        if self.law is None:
            return 0.5 * self.reluctivity * np.sum((b - self.remanence) ** 2, axis=0)
        now, rest = (self.law.energy(np.hypot(*each)) for each in (b, self.remanence))
        return now - rest - np.sum(self.coercivity * (b - self.remanence), axis=0)

    def _secant(self, b: np.ndarray) -> np.ndarray:
        size = np.hypot(*b)
        if self.law is None:
            return np.full(size.shape, self.reluctivity)
        positive = size > 1e-9  # T: the quotient would be rounding error
        return np.where(positive, self.law.field_strength(size) / np.where(positive, size, 1.0), self.law.slope(size))


def _inverse(law: Law, strength: np.ndarray) -> np.ndarray:
    low, high = np.zeros_like(strength), np.ones_like(strength)
    while np.any(law.field_strength(high) < strength):
        high = 2.0 * high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        below = law.field_strength(middle) < strength
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)
