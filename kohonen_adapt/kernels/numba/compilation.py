"""Compilation of kernels on first use, and records of arrays as arguments.

Machine code is cached on disk.
"""

import functools
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar, get_type_hints

import numba
import numpy as np
from numba import config, types

from kohonen_adapt.kernels.numba.switch import CACHED, PLAIN

if not PLAIN:
    from kohonen_adapt.kernels.numba.compiler import InnerCompiler, KernelCompiler, Loop
    from kohonen_adapt.kernels.numba.fast_records import RecordType, register
if CACHED:
    from kohonen_adapt.kernels.numba.cache import DeferredCache

__all__ = [
    "expect",
    "expected",
    "inner_kernel",
    "interpreted",
    "kernel",
    "number_of_threads",
    "record",
    "record_type",
    "type_of",
    "zeros",
]

expected: set[str] = set()

OPTIONS = {"nopython": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False}
Record = TypeVar("Record", bound=type)
Scratch = TypeVar("Scratch")
NUMBERS = {float: types.float64, int: types.int64, bool: types.boolean}


def kernel(function: Callable) -> Callable:
    """Return a compiled loop that Python calls.

    Arithmetic follows IEEE 754, so that a seed gives the same bits. A kernel cannot allocate arrays.
    """
    return _compiled(function, inner=False)


def inner_kernel(function: Callable) -> Callable:
    """Return a compiled loop that only kernels call, without a wrapper for Python."""
    return _compiled(function, inner=True)


def record(record_class: Record) -> Record:
    """Pass a named tuple by address to kernels, which may read the fields.

    Plain numba unpacks the tuple.
    """
    if not PLAIN:
        register(record_class)
    return record_class


def type_of(argument: Any) -> types.Type:
    """Return the type of numba for a record, a type of `array_types` or a number.

    Types of numba are returned as they are.
    """
    if argument in NUMBERS:
        return NUMBERS[argument]
    if hasattr(argument, "_fields"):
        return record_type(argument)
    return types.Array(*argument.__metadata__, "C") if hasattr(argument, "__metadata__") else argument


def record_type(record_class: Any, **fields: Any) -> types.Type:
    """Return the type of a record by its annotations, or by `fields` if given."""
    kinds = tuple(map(type_of, (_annotations(record_class) | fields).values()))
    return types.NamedTuple(kinds, record_class) if PLAIN else RecordType(record_class, kinds)


def zeros(record_class: Callable[..., Scratch], *fields: Any) -> Scratch:
    """Return a record with arrays of zeros.

    `fields` are the shapes of the arrays, or arrays of other entries.
    """
    kinds = (str(kind.__metadata__[0]) for kind in _annotations(record_class).values())
    pairs = zip(fields, kinds, strict=True)
    return record_class(*(each if isinstance(each, np.ndarray) else np.zeros(each, kind) for each, kind in pairs))


@functools.cache
def _annotations(record_class: Any) -> dict[str, Any]:
    return get_type_hints(record_class, include_extras=True)


def expect(*chapters: str) -> None:
    """Register groups of `kernels/entries.py` for compilation ahead of use."""
    expected.update(chapters)


@functools.cache
def interpreted(loop: Any) -> Callable:
    """Return a kernel as a Python function, with the kernels called as well."""
    function = getattr(loop, "py_func", loop)
    called = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    own = {name: interpreted(value) for name, value in called.items() if hasattr(value, "py_func")}
    return FunctionType(function.__code__, {**function.__globals__, **own})


def number_of_threads() -> int:
    """Return the number of threads, as set by ``NUMBA_NUM_THREADS``.

    The default is the number of cores available to the process. No result depends on the number of threads.
    """
    return max(1, config.NUMBA_NUM_THREADS)


def _compiled(function: Callable, inner: bool) -> Callable:
    if config.DISABLE_JIT:
        return function
    if PLAIN:
        loop = numba.njit(nogil=True, error_model="numpy")(function)
    else:
        options = {**OPTIONS, "no_cpython_wrapper": inner}
        loop = Loop(function, targetoptions=options, pipeline_class=InnerCompiler if inner else KernelCompiler)
    if CACHED:
        loop._cache = DeferredCache(function)
    return loop
