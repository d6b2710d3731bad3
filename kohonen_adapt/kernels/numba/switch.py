"""Choice between the fast compiler of kernels and plain numba.

The fast compiler, records passed by address and the cache use numba's inner modules, which may change in any release.
Plain numba compiles the same kernels in 2.4 to 2.9 times the time. Rounding may differ.
"""

import logging
import os
from importlib import import_module

import numba

__all__ = ["CACHED", "PLAIN", "SWITCH"]

logger = logging.getLogger("kohonen_adapt")

SWITCH = "KOHONEN_ADAPT_PLAIN_NUMBA"
FAST = ("compiler", "fast_records")

# Methods of numba that the fast compiler and the cache override, by module and class.
OVERRIDDEN = {
    "numba.core.codegen.JITCodeLibrary": ("_optimize_final_module", "_finalize_final_module"),
    "numba.core.codegen.JITCPUCodegen": ("unserialize_library", "set_env"),
    "numba.core.typing.Context": ("resolve_function_type",),
    "numba.core.registry.CPUTarget": ("_toplevel_typing_context", "_toplevel_target_context"),
    "numba.core.registry.CPUDispatcher": ("compile", "get_call_template", "enable_caching"),
    "numba.core.compiler.Flags": ("values",),
}
OVERRIDDEN_BY_CACHE = {
    "numba.core.caching.IndexDataCacheFile": ("load", "save", "_load_index", "_save_index", "_save_data", "_data_name"),
    "numba.core.caching.FunctionCache": ("save_overload", "_index_key"),
}


def usable(modules: tuple[str, ...], overridden: dict[str, tuple[str, ...]], otherwise: str) -> bool:
    try:
        for path, names in overridden.items():
            module, _, owner = path.rpartition(".")
            found = getattr(import_module(module), owner)
            for name in names:
                getattr(found, name)
        for name in modules:
            import_module(f"{__package__}.{name}")
    except Exception as error:  # inner modules may fail in any way
        text = "numba %s differs from the versions known to kohonen_adapt (%s: %s), so %s."
        logger.warning(text, numba.__version__, type(error).__name__, error, otherwise)
        return False
    return True


PLAIN = os.environ.get(SWITCH, "0") not in ("", "0") or not usable(FAST, OVERRIDDEN, "loops are compiled more slowly")
"""True if kernels are compiled by plain numba."""

CACHED = usable(("cache",), OVERRIDDEN_BY_CACHE, "every process compiles loops again")
"""True if machine code is stored on disk."""
