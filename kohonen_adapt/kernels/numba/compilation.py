"""Compilation of kernels on first use, with a cache of machine code on disk."""

import functools
from collections.abc import Callable
from types import FunctionType
from typing import Any

import numba
from numba import config

from kohonen_adapt.kernels.numba.switch import CACHED, PLAIN

if not PLAIN:
    from kohonen_adapt.kernels.numba.compiler import InnerCompiler, KernelCompiler, Loop
if CACHED:
    from kohonen_adapt.kernels.numba.cache import KernelCache

__all__ = ["expect", "expected", "inner_kernel", "interpreted", "kernel", "number_of_threads"]

expected: set[str] = set()


OPTIONS = {"nopython": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False}


def kernel(function: Callable) -> Callable:
    """Return a compiled loop that Python calls.

    Arithmetic follows IEEE 754, so that a seed gives the same bits. A kernel cannot allocate arrays.
    """
    return _compiled(function, inner=False)


def inner_kernel(function: Callable) -> Callable:
    """Return a compiled loop that only kernels call, without a wrapper for Python."""
    return _compiled(function, inner=True)


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
        loop._cache = KernelCache(function, "plain" if PLAIN else "fast")
    return loop
