"""Problems on which mesh movers were published, from their public definitions."""

import numpy as np
from skfem import MeshTri

from benchmarks.problems import helmholtz
from benchmarks.problems.helmholtz import square_mesh
from benchmarks.problems.manufactured import Function, WithFunctional

COSINES = {  # UGM2N: the function, its wave numbers in units of pi along x and y, and the reaction
    "Poisson, cos 2 pi x cos 2 pi y": (np.cos, (2, 2), 0.0),
    "Poisson, sin 4 pi x sin 4 pi y": (np.sin, (4, 4), 0.0),
    "Helmholtz, cos 2 pi y": (np.cos, (0, 2), 1.0),
    "Helmholtz, cos 2 pi x cos 2 pi y": (np.cos, (2, 2), 1.0),
    "Helmholtz, cos 4 pi x cos 2 pi y": (np.cos, (4, 2), 1.0),
}


def gaussians(number: int) -> tuple[WithFunctional, MeshTri]:
    """Return problem `number` with two or three Gaussians, on 12 to 23 nodes a side, as G-Adaptivity draws them."""
    rng = np.random.default_rng(number)
    count = int(rng.integers(2, 4))
    centres, widths = rng.random((count, 2)), rng.uniform(0.1, 0.5, count)

    def parts(x: np.ndarray) -> list[tuple[np.ndarray, float, np.ndarray]]:
        squared = [(x[0] - c[0]) ** 2 + (x[1] - c[1]) ** 2 for c in centres]
        return [(r2, s, np.exp(-r2 / s**2)) for r2, s in zip(squared, widths, strict=True)]

    def exact(x: np.ndarray) -> np.ndarray:
        return np.sum([value for _, _, value in parts(x)], axis=0)

    def laplacian(x: np.ndarray) -> np.ndarray:
        return np.sum([(4 * r2 / s**4 - 4 / s**2) * value for r2, s, value in parts(x)], axis=0)

    return WithFunctional(exact, laplacian), square_mesh(11 + number % 12)


def cosines(name: str, squares: int) -> tuple[WithFunctional, MeshTri]:
    """Return a problem of `COSINES` on squares x squares squares."""
    function, (along_x, along_y), reaction = COSINES[name]
    return WithFunctional(*_product(function, np.pi * along_x, np.pi * along_y), reaction), square_mesh(squares)


def bump() -> tuple[WithFunctional, MeshTri]:
    """Return the demonstration of Firedrake's movement on its mesh."""
    return WithFunctional(helmholtz.bump, helmholtz.laplacian, 1.0), square_mesh(20)


def _product(function: Function, a: float, b: float) -> tuple[Function, Function]:
    def exact(x: np.ndarray) -> np.ndarray:
        return function(a * x[0]) * function(b * x[1])

    def laplacian(x: np.ndarray) -> np.ndarray:
        return -(a**2 + b**2) * exact(x)

    return exact, laplacian
