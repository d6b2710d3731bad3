"""Write files whole or not at all."""

import errno
import os
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

__all__ = ["remove_drafts", "save_figure", "whole_file", "whole_files", "write_whole"]

DRAFT, SUFFIX = f".kohonen-adapt.{platform.node()}.", ".draft"  # of the folders of drafts, around the process
LONG = 86400.0  # s; age of abandoned drafts on systems without signals


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a draft to write, which is renamed to `path` unless an exception occurs.

    The draft is on disk before the renaming, and the name at the end, so a power cut leaves the old file or the new
    file. A file that is replaced passes its mode on.

    Parameters
    ----------
    path
        Final name of the file.

    Yields
    ------
    Path
        A file that does not exist yet, of the same name in a new folder beside `path`, so that the renaming is atomic.

    Raises
    ------
    OSError
        If the folder is missing or read-only, or `path` is a device. The error has the name `path`, not that of the
        draft.
    """
    if not path.parent.is_dir():
        raise FileNotFoundError(f"cannot write '{path.name}': there is no folder '{path.parent}'. Create it first.")
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "expected the name of a file; got that of a folder or device", str(path))
    try:
        with _draft_folder(path.parent) as folder:
            yield folder / path.name
            _give_name(folder / path.name, path)
            _sync_names(path.parent)
    except OSError as error:
        raise _renamed(error, path) from error


@contextmanager
def whole_files(folder: Path) -> Iterator[Path]:
    """Yield a folder for several files, and move all to `folder` at the end.

    An exception leaves `folder` as it was.

    Yields
    ------
    Path
        A folder within `folder`, so that its files need only be renamed.

    Raises
    ------
    OSError
        If the files cannot be written. The error has the final name of the file.
    """
    try:
        with _draft_folder(folder) as draft:
            yield draft
            for file in sorted(draft.iterdir()):
                _give_name(file, folder / file.name)
            _sync_names(folder)
    except OSError as error:
        name = Path(os.fsdecode(error.filename)).name if isinstance(error.filename, str | bytes) else ""
        raise _renamed(error, folder / name) from error


def remove_drafts(folder: Path) -> None:
    # Drafts whose process on this computer has ended are removed.
    for draft in folder.glob(f"{DRAFT}*{SUFFIX}"):
        if not _is_written(draft):
            shutil.rmtree(draft, ignore_errors=True)


def _is_written(draft: Path) -> bool:
    process = draft.name.removeprefix(DRAFT).partition(".")[0]
    try:
        if sys.platform == "win32" or not process.isdecimal():  # without a harmless signal
            return time.time() - draft.stat().st_mtime < LONG
        os.kill(int(process), 0)
    except (ProcessLookupError, FileNotFoundError):
        return False
    except (OSError, OverflowError):  # of another user
        return True
    return True


def write_whole(path: Path, content: bytes) -> None:
    with whole_file(path) as draft:
        draft.write_bytes(content)


def save_figure(path: Path, figure: Any) -> None:
    with whole_file(path) as draft:
        figure.savefig(draft, format="png")


@contextmanager
def _draft_folder(folder: Path) -> Iterator[Path]:
    """Yield a folder within `folder`, which is removed at the end."""
    draft = Path(tempfile.mkdtemp(SUFFIX, f"{DRAFT}{os.getpid()}.", folder))
    try:
        yield draft
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _give_name(draft: Path, path: Path) -> None:
    with draft.open("rb+") as stream:
        if path.exists() and (mode := path.stat().st_mode) != draft.stat().st_mode:
            draft.chmod(mode & 0o777)
        os.fsync(stream.fileno())
    os.replace(draft, path)


def _sync_names(folder: Path) -> None:
    if sys.platform == "win32":
        return
    with suppress(OSError):  # some file systems cannot sync folders, and the file is written
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _renamed(error: OSError, path: Path) -> OSError:
    return OSError(error.errno or errno.EIO, error.strerror or str(error), str(path))
