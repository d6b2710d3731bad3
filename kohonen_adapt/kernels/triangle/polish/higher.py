"""Loops of the polish for functions of order 2 and 3, or around an axis."""

from kohonen_adapt.kernels.numba.compilation import kernel
from kohonen_adapt.kernels.triangle.arrays import WITH
from kohonen_adapt.kernels.triangle.polish.descend import descend_each
from kohonen_adapt.kernels.triangle.polish.exchange import exchange_each, weigh_each
from kohonen_adapt.kernels.triangle.polish.flips import flip_each


@kernel
def exchange(mesh, descents, offers, edges, nodes, floor):
    return exchange_each(mesh, descents, WITH, offers, edges, nodes, floor)


@kernel
def weigh(mesh, descents, offers, most, floor, first, last, edges):
    weigh_each(mesh, descents, WITH, offers, most, floor, first, last, edges)


@kernel
def descend_flips(descents, floor, gainful, first, last, marks):
    return flip_each(descents, WITH, floor, gainful, first, last, marks)


@kernel
def descend_nodes(descents, order, floor):
    return descend_each(descents, WITH, order, floor)
