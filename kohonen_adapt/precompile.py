"""Compilation of all kernels ahead of use, for benchmarks and containers."""

from itertools import chain

from kohonen_adapt.kernels.entries import ENTRIES, IN_SPACE
from kohonen_adapt.kernels.numba.compilation import expect
from kohonen_adapt.kernels.numba.switch import CACHED, PLAIN

if CACHED:
    from kohonen_adapt.kernels.numba.cache import is_cacheable, is_cached
if CACHED and not PLAIN:  # the second process leaves code in the cache, for types known to the fast compiler alone
    from kohonen_adapt.kernels.numba.ahead import compile_ahead

    compile_ahead()  # before any first use, not by `warmup` only


IN_PLANE = {chapter: entries for chapter, entries in ENTRIES.items() if chapter not in IN_SPACE}


def warmup(space: bool = False) -> None:
    """Compile all kernels now, or load them from numba's cache.

    Parameters
    ----------
    space
        True to compile the kernels of tetrahedra, too.

    Notes
    -----
    Otherwise the first call of `relocate`, `adapt`, `polish`, `KohonenMap` or `interpolate` compiles them, which takes
    some seconds once per installation; later calls load them from the cache on disk.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.warmup()  # doctest: +SKIP
    """
    chapters = ENTRIES if space else IN_PLANE
    expect(*chapters)
    for entry in chain(*chapters.values()):
        entry.compile()


def compile_missing() -> None:
    # Nothing is loaded if all are in the cache: the check takes 0.01 s, and `warmup` 0.5 s. Nothing is compiled if
    # the cache cannot be written, because no other process would find the code.
    if not CACHED:
        return
    # Without numba, loops are plain functions.
    compiled = [entry for entry in chain(*IN_PLANE.values()) if hasattr(entry.loop, "py_func")]
    missing = [entry for entry in compiled if not is_cached(entry.loop, entry.types)]
    if missing and is_cacheable(missing[0].loop):
        warmup()
