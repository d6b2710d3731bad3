"""Quadrature degrees of elements with a B-H law."""

__all__ = ["LAW_DEGREE", "LAW_DEGREE_BY_POINTS"]

# By order of the elements, in the equations, the functional and its descent alike. The functional of random problems on
# coarse meshes is within 1 % of its fall under refinement of that by degree 16 (`python -m benchmarks nonlinear`). Of
# 400 problems two were not with degree 12 at order 3, by 7 %. A polish by degree 6 moves nodes of order 3 to where the
# points flatter, below the exact functional.
LAW_DEGREE = {1: 0, 2: 10, 3: 14}  # straight sides, constant gradients at order 1
LAW_DEGREE_BY_POINTS = {1: 8, 2: 14, 3: 14}  # curved sides, and around an axis
