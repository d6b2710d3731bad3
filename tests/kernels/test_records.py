"""Kernels read and write the arrays of a record, nested ones too, and leave no reference behind."""

import sys
from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel, record


@record
class Inside(NamedTuple):
    table: np.ndarray
    count: int


@record
class Outside(NamedTuple):
    values: np.ndarray
    inside: Inside


@inner_kernel
def shift(outside, by):
    table = outside.inside.table
    for i in range(table.shape[0]):
        for j in range(table.shape[1]):
            table[i, j] += by * outside.values[i] + outside.inside.count


@kernel
def shift_all(outside, by):
    shift(outside, by)
    return outside.values.size + outside.inside.table.size


@kernel
def columns(inside):
    first = total = 0.0
    for row in range(inside.table.shape[0]):
        first += inside.table[row, 0]
    for column in inside.table.T:
        for value in column:
            total += value
    return first, total


def example(order="C"):
    table = np.array(np.arange(6.0).reshape(3, 2), order=order)
    return Outside(np.array([1.0, 2.0, 3.0]), Inside(table, 7))


@pytest.mark.parametrize("order", ["C", "F"])
def test_a_kernel_changes_the_arrays_of_its_caller(order):
    outside, by = example(order), 0.5
    assert shift_all(outside, by) == 9
    assert_array_equal(outside.inside.table, example().inside.table + [[7.5], [8.0], [8.5]])


def test_views_have_their_strides():
    outside = example()
    half = Outside(np.arange(12.0)[::4], Inside(np.arange(24.0).reshape(6, 4)[::2, 1:3].copy(), 0))
    assert shift_all(half, 1.0) == 9
    assert_array_equal(half.inside.table, [[1.0, 2.0], [13.0, 14.0], [25.0, 26.0]])
    first, total = columns(Inside(np.arange(24.0).reshape(6, 4)[::2, 1:3], 0))
    assert (first, total) == (27.0, 57.0)
    assert columns(outside.inside) == (6.0, 15.0)


def test_no_reference_is_left_behind():
    outside = example()
    shift_all(outside, 1.0)
    before = [sys.getrefcount(array) for array in (outside.values, outside.inside.table, outside, outside.inside)]
    for _ in range(100):
        shift_all(outside, 1.0)
    after = [sys.getrefcount(array) for array in (outside.values, outside.inside.table, outside, outside.inside)]
    assert after == before
