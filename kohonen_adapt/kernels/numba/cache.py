"""Cache of machine code on disk, through numba's inner modules."""

import functools
import logging
import os
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from hashlib import blake2b
from io import BytesIO
from pathlib import Path
from typing import Any, ClassVar

import numba
from numba import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile

try:
    from numba.core.caching import InTreeCacheLocator, UserProvidedCacheLocator
except ImportError:  # numba 0.61
    from numba.core.caching import _InTreeCacheLocator as InTreeCacheLocator
    from numba.core.caching import _UserProvidedCacheLocator as UserProvidedCacheLocator

__all__ = ["DeferredCache", "is_cacheable", "is_cached"]

logger = logging.getLogger("kohonen_adapt")

SEAL = 16  # bytes of the hash at the beginning of a file of machine code

NOT_CACHED = (
    "compiled loops of kohonen_adapt cannot be stored in '%s' (%s), so every process compiles them again. Set "
    "NUMBA_CACHE_DIR to a writable folder."
)


def is_cached(loop: Any, types: tuple[Any, ...]) -> bool:
    cache = loop._cache
    return cache._index_key(types, loop.targetctx.codegen()) in cache._cache_file._load_index()


def is_cacheable(loop: Any) -> bool:
    folder = Path(loop._cache.cache_path)
    there = next(path for path in (folder, *folder.parents) if os.path.exists(path))
    return there.is_dir() and os.access(there, os.W_OK)


@functools.cache
def _contents_of_all_kernels(compiler: str) -> str:
    """Return a hash of all files of kernels and the name of the compiler.

    numba checks only the file of a function, although code of functions called from other files is linked into it.
    """
    folder, found = Path(__file__).parents[1], blake2b(compiler.encode(), digest_size=16)
    for path in sorted(folder.rglob("*.py")):
        found.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()


class _KernelFiles(IndexDataCacheFile):
    """Machine code of one function, in a file per signature and state of the kernels.

    Each file begins with a hash of the rest. An unreadable or damaged file counts as missing.
    """

    _version: str

    def __init__(self, cache_path: str, filename_base: str, stamp: str) -> None:
        super().__init__(cache_path, filename_base, stamp)
        # read before the rest of an index, which may refer to modules that no longer exist
        self._version = f"{numba.__version__} {stamp}"

    def load(self, key: Any) -> Any:
        try:
            return pickle.loads(_unsealed(self._data_path(self._load_index()[key])))
        except Exception:  # pickle raises errors of any kind
            return None

    def save(self, key: Any, data: Any) -> None:
        """Write the code, then the index.

        A name determines the code, so a concurrent process that reads the index finds the right code.
        """
        overloads = self._load_index()
        if not overloads:
            self._remove_code_of_other_kernels()
        digest = blake2b(repr((self._source_stamp, key)).encode(), digest_size=8).digest()
        name = self._data_name(int.from_bytes(digest, "big"))
        self._save_data(name, data)
        self._save_index({**overloads, key: name})

    def _load_index(self) -> dict[Any, str]:
        try:
            stream = BytesIO(_unsealed(self._index_path))
            if pickle.load(stream) != self._version:
                return {}
            _, overloads = pickle.load(stream)
        except Exception:  # pickle raises errors of any kind
            return {}
        return overloads

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[BytesIO]:
        with super()._open_for_write(filepath) as stream:
            content = BytesIO()
            yield content
            stream.write(_seal(content.getvalue()) + content.getvalue())

    def _remove_code_of_other_kernels(self) -> None:
        for path in Path(self._cache_path).glob(self._index_name.removesuffix("nbi") + "*.nbc"):
            with suppress(OSError):
                path.unlink()


def _seal(content: bytes) -> bytes:
    return blake2b(content, digest_size=SEAL).digest()


def _unsealed(path: str) -> bytes:
    sealed = Path(path).read_bytes()
    if _seal(sealed[SEAL:]) != sealed[:SEAL]:
        raise ValueError(f"'{path}' is damaged.")
    return sealed[SEAL:]


class _ReadOnlyLocator(InTreeCacheLocator):
    def __init__(self, py_func: Any, py_file: str) -> None:
        super().__init__(py_func, py_file)
        if config.CACHE_DIR:
            self._cache_path = UserProvidedCacheLocator(py_func, py_file).get_cache_path()

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> "_ReadOnlyLocator":
        return cls(py_func, py_file)


class _KernelCode(CompileResultCacheImpl):
    _locator_classes: ClassVar = [*CompileResultCacheImpl._locator_classes, _ReadOnlyLocator]


class DeferredCache:
    # A `KernelCache`, made at its first use, because numba tries to write a file for each and a run uses few of them.

    def __init__(self, function: Callable, compiler: str) -> None:
        self._arguments = function, compiler

    @functools.cached_property
    def _cache(self) -> "KernelCache":
        return KernelCache(*self._arguments)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cache, name)


class KernelCache(FunctionCache):
    """Cache of numba on disk, invalidated by the contents of the kernels' files.

    If code cannot be written, the first failure is logged as a warning.
    """

    _impl_class = _KernelCode
    _warned = False

    def __init__(self, function: Callable, compiler: str) -> None:
        super().__init__(function)
        self._cache_file = _KernelFiles(self.cache_path, self._impl.filename_base, _contents_of_all_kernels(compiler))

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError as error:
            if not KernelCache._warned:
                logger.warning(NOT_CACHED, self.cache_path, error.strerror or error)
            KernelCache._warned = True
