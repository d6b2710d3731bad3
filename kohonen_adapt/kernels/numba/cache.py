"""Cache of machine code on disk, through numba's inner modules."""

import functools
import logging
import os
import pickle
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from hashlib import blake2b
from io import BytesIO
from pathlib import Path
from typing import Any, ClassVar

import numba
from numba import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
from numba.misc.appdirs import AppDirs

from kohonen_adapt.kernels.numba.switch import PLAIN  # known before the switch imports this file

try:
    from numba.core.caching import InTreeCacheLocator
except ImportError:  # numba 0.61
    from numba.core.caching import _InTreeCacheLocator as InTreeCacheLocator

__all__ = ["DeferredCache", "is_cacheable", "is_cached"]

logger = logging.getLogger("kohonen_adapt")

PREFIX = "kernels-"
KEPT = 8  # states of the kernels, of at most 40 MB each
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
def _contents_of_all_kernels() -> str:
    # numba checks only the file of a function, although code of other files is linked
    compiler = f"{'plain' if PLAIN else 'fast'} {numba.__version__}"
    folder = Path(__file__).parents[1]
    found = blake2b(compiler.encode(), digest_size=16)
    for path in sorted(folder.rglob("*.py")):
        found.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()


@functools.cache
def _shared_folder() -> Path:
    # the same for every copy of the package that has these kernels
    root = config.CACHE_DIR or AppDirs(appname="kohonen_adapt", appauthor=False).user_cache_dir
    folder = Path(root) / f"{PREFIX}{_contents_of_all_kernels()}"
    with suppress(OSError):  # as the last use, for `_remove_oldest`
        os.utime(folder)
    return folder


def _remove_oldest(root: Path) -> None:
    found = [(path.stat().st_mtime, path) for path in root.glob(f"{PREFIX}*") if path.is_dir()]
    for _, path in sorted(found)[:-KEPT]:
        shutil.rmtree(path, ignore_errors=True)


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


def _seal(content: bytes) -> bytes:
    return blake2b(content, digest_size=SEAL).digest()


def _unsealed(path: str) -> bytes:
    sealed = Path(path).read_bytes()
    if _seal(sealed[SEAL:]) != sealed[:SEAL]:
        raise ValueError(f"'{path}' is damaged.")
    return sealed[SEAL:]


class _SharedLocator(InTreeCacheLocator):
    def __init__(self, py_func: Any, py_file: str) -> None:
        super().__init__(py_func, py_file)
        self._shared = _shared_folder()
        self._cache_path = str(self._shared / py_func.__module__)

    def ensure_cache_path(self) -> None:
        if not self._shared.exists():
            self._shared.mkdir(parents=True, exist_ok=True)
            _remove_oldest(self._shared.parent)
        super().ensure_cache_path()


class _ReadOnlyLocator(_SharedLocator):
    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> "_ReadOnlyLocator":
        return cls(py_func, py_file)


class _KernelCode(CompileResultCacheImpl):
    _locator_classes: ClassVar = [_SharedLocator, *CompileResultCacheImpl._locator_classes, _ReadOnlyLocator]


class DeferredCache:
    # A `KernelCache`, made at its first use, because numba tries to write a file for each and a run uses few of them.

    def __init__(self, function: Callable) -> None:
        self._function = function

    @functools.cached_property
    def _cache(self) -> "KernelCache":
        return KernelCache(self._function)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cache, name)


class KernelCache(FunctionCache):
    """Cache of numba on disk, invalidated by the contents of the kernels' files.

    If code cannot be written, the first failure is logged as a warning.
    """

    _impl_class = _KernelCode
    _warned = False

    def __init__(self, function: Callable) -> None:
        super().__init__(function)
        self._cache_file = _KernelFiles(self.cache_path, self._impl.filename_base, _contents_of_all_kernels())

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError as error:
            if not KernelCache._warned:
                logger.warning(NOT_CACHED, self.cache_path, error.strerror or error)
            KernelCache._warned = True
