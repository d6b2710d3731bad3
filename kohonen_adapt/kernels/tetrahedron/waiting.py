"""Ring buffer of the elements that wait for a search."""

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.arrays import ELSEWHERE, FREE, WAITS, WANTED


@inner_kernel
def enter(queue, e):
    if queue.waiting[e] == FREE:
        rows = queue.element.shape[0]
        queue.element[(queue.state[0] + queue.state[1]) % rows] = e
        queue.state[1] += 1
        queue.waiting[e] = WAITS


@inner_kernel
def take_first(queue):
    e = queue.element[queue.state[0]]
    queue.state[0] = (queue.state[0] + 1) % queue.element.shape[0]
    queue.state[1] -= 1
    queue.waiting[e] = FREE
    return e


@inner_kernel
def is_blocked(queue, e):
    """Return True if an element waits, and request elements of a different part."""
    if queue.waiting[e] == ELSEWHERE:
        queue.waiting[e] = WANTED
    return queue.waiting[e] != FREE


@inner_kernel
def enter_made(mesh, queue, count):
    for i in range(count):
        enter(queue, mesh.cavity.made[i])
