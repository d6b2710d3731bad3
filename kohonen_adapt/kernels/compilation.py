"""How kernels are compiled: on first use, cached on disk, and said through logging."""

import logging
from collections.abc import Callable

from numba import config, njit
from numba.core import event

__all__ = ["inner_kernel", "kernel", "number_of_threads"]

logger = logging.getLogger("kohonen_adapt")


def kernel(function: Callable) -> Callable:
    """Compile a loop on first use and keep it on disk; arithmetic follows IEEE, so a seed gives the same bits."""
    return njit(function, cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True)


def inner_kernel(function: Callable) -> Callable:
    """The same for what only kernels call: without the ways in from Python, which take long to compile."""
    return njit(function, cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True, no_cpython_wrapper=True)


def number_of_threads() -> int:
    """How many threads share the work of kernels: what numba takes from the cores that the process may use.

    The environment variable ``NUMBA_NUM_THREADS`` sets it. No result depends on it.
    """
    return max(1, config.NUMBA_NUM_THREADS)


class _Announcer(event.Listener):
    """Says once that kernels are being compiled; numba raises the event only where its cache has nothing."""

    def __init__(self) -> None:
        self.said = False

    def on_start(self, event: event.Event) -> None:
        function = event.data["dispatcher"].py_func
        if not self.said and function.__module__.startswith(__package__):
            self.said = True
            logger.info("compiling the loops of kohonen_adapt (up to a minute, once; numba caches them on disk)")

    def on_end(self, event: event.Event) -> None:
        """Nothing: the start is what a waiting user wants to know."""


event.register("numba:compile", _Announcer())
