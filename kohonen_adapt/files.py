"""Write files whole or not at all."""

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

__all__ = ["remove_drafts", "save_figure", "whole_file", "whole_files"]


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a draft beside `path` to write to; it takes the name of `path` if nothing went wrong, else it goes.

    Parameters
    ----------
    path
        The file that is wanted.

    Yields
    ------
    Path
        A file that does not exist yet, in the same folder, so that the final renaming is one step of the file system.

    Raises
    ------
    OSError
        If the folder is missing or does not take the file; it carries the name `path`, not that of the draft.
    """
    if not path.parent.is_dir():
        raise FileNotFoundError(f"cannot write '{path.name}': there is no folder '{path.parent}'. Create it first.")
    draft = path.with_name(f".{path.name}.{os.getpid()}.draft")
    try:
        yield draft
        os.replace(draft, path)
    except OSError as error:
        error.filename, error.filename2 = str(path), None
        raise
    finally:
        draft.unlink(missing_ok=True)


@contextmanager
def whole_files(folder: Path) -> Iterator[Path]:
    """Give a folder to write files to that belong together; they come to `folder` together if nothing went wrong.

    Yields
    ------
    Path
        An empty folder within `folder`, so that its files need only be renamed.

    Raises
    ------
    OSError
        If the folder does not take them; it carries the name that the file was to have.
    """
    draft = folder / f".files.{os.getpid()}.draft"
    draft.mkdir()
    try:
        yield draft
        for file in sorted(draft.iterdir()):
            os.replace(file, folder / file.name)
    except OSError as error:
        if error.filename is not None:
            error.filename, error.filename2 = str(folder / Path(error.filename).name), None
        raise
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def remove_drafts(folder: Path, *names: str) -> None:
    """Remove the drafts of files of these names, without names of any, that killed processes left in a folder.

    Raises
    ------
    OSError
        If one cannot be removed.
    """
    pattern = re.compile(rf"\.({'|'.join(map(re.escape, names)) or '.+'})\.[0-9]+\.draft")
    for draft in folder.iterdir():
        if pattern.fullmatch(draft.name) and draft.is_dir():
            shutil.rmtree(draft)
        elif pattern.fullmatch(draft.name):
            draft.unlink(missing_ok=True)


def save_figure(path: Path, figure: Any) -> None:
    """Write a figure of matplotlib."""
    with whole_file(path) as draft:
        figure.savefig(draft, format="png")
