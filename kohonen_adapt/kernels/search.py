"""Steps of a search that are the same on triangles and on tetrahedra."""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel


@inner_kernel
def next_stamp(scratch):
    scratch.counter[0] += 1
    return scratch.counter[0]


@inner_kernel
def element_in_region(elements, star, v, region):
    for k in range(star.start[v], star.start[v + 1]):
        if elements.region[star.element[k]] == region:
            return np.int64(star.element[k])
    return np.int64(star.element[star.start[v]])
