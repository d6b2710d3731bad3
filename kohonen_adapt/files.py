"""Write files whole or not at all."""

import errno
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

if sys.platform != "win32":
    import fcntl

__all__ = ["remove_drafts", "save_figure", "whole_file", "whole_files"]

PREFIX, SUFFIX = ".kohonen-adapt.", ".draft"  # of the folders that files are written in
LOCK = "kohonen-adapt.lock"  # in each of these folders, locked by the writer


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a draft to write, and rename it to `path` unless an exception occurs.

    The draft is on disk before the renaming, and the name at the end, so a power cut leaves the old file or the new
    one. A file that is replaced passes its mode on.

    Parameters
    ----------
    path
        The file that is wanted.

    Yields
    ------
    Path
        A file that does not exist yet, of the same name in a folder of its own beside `path`, so that the final
        renaming is one step of the file system.

    Raises
    ------
    OSError
        If the folder is missing or does not take the file, or `path` is a device. The error carries the name `path`,
        not that of the draft.
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
        If the folder does not take them. The error carries the name that the file was to have.
    """
    try:
        with _draft_folder(folder) as draft:
            yield draft
            for file in sorted(draft.iterdir()):
                if file.name != LOCK:
                    _give_name(file, folder / file.name)
            _sync_names(folder)
    except OSError as error:
        name = Path(os.fsdecode(error.filename)).name if isinstance(error.filename, str | bytes) else ""
        raise _renamed(error, folder / name) from error


def remove_drafts(folder: Path) -> None:
    """Remove the drafts that killed processes left in a folder.

    The system drops the lock of a draft when its writer ends, however that ends. So a draft whose lock can be had
    belongs to nobody, and the others stay, like those on file systems without locks and those of other users.
    """
    for draft in folder.glob(f"{PREFIX}*{SUFFIX}"):
        with suppress(OSError):
            _remove_abandoned(draft)


def save_figure(path: Path, figure: Any) -> None:
    """Write a figure of matplotlib."""
    with whole_file(path) as draft:
        figure.savefig(draft, format="png")


@contextmanager
def _draft_folder(folder: Path) -> Iterator[Path]:
    """Yield a locked folder within `folder`, and remove it at the end.

    Files in it get the mode and the access rights of any new file, and no other user can plant a link there.
    """
    draft, lock = _locked_folder(folder)
    try:
        yield draft
    finally:
        lock.close()
        shutil.rmtree(draft, ignore_errors=True)


def _locked_folder(folder: Path) -> tuple[Path, IO[bytes]]:
    while True:
        draft = Path(tempfile.mkdtemp(SUFFIX, PREFIX, folder))
        try:
            lock = (draft / LOCK).open("xb")
        except FileNotFoundError:  # `remove_drafts` took the folder, which had no lock yet
            continue
        except OSError:
            draft.rmdir()
            raise
        if _lock(lock, without=True) and os.fstat(lock.fileno()).st_nlink:
            return draft, lock
        lock.close()  # `remove_drafts` was faster


def _remove_abandoned(draft: Path) -> None:
    if sys.platform == "win32":
        (draft / LOCK).unlink()  # Windows refuses this while the writer has the file open
        shutil.rmtree(draft)
    elif not (draft / LOCK).exists():
        draft.rmdir()  # the writer was killed before it had a lock, or will make another folder
    else:
        with (draft / LOCK).open("r+b") as lock:
            if _lock(lock, without=False):
                shutil.rmtree(draft)


def _lock(file: IO[bytes], without: bool) -> bool:
    """Return True if a lock was free, and `without` if the system has none."""
    if sys.platform != "win32":
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:
            return without
    return True


def _give_name(draft: Path, path: Path) -> None:
    """Rename a draft whose content is on disk."""
    with draft.open("rb+") as stream:
        if path.exists() and (mode := path.stat().st_mode) != draft.stat().st_mode:
            draft.chmod(mode & 0o777)
        os.fsync(stream.fileno())
    os.replace(draft, path)


def _sync_names(folder: Path) -> None:
    if sys.platform == "win32":
        return
    with suppress(OSError):  # the file is there, and not every file system syncs folders
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _renamed(error: OSError, path: Path) -> OSError:
    """Return the error with the name of a file, which numpy leaves out."""
    return OSError(error.errno or errno.EIO, error.strerror or str(error), str(path))
