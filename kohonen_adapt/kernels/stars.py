"""Stars of nodes."""

from kohonen_adapt.kernels.numba.compilation import inner_kernel

__all__ = ["rows_of"]


@inner_kernel
def rows_of(star, v):
    """Return the rows of `star` that node `v` has."""
    return range(star.start[v], star.start[v + 1])
