"""A file that is written whole or not at all."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["remove_drafts", "whole_file"]


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


def remove_drafts(folder: Path, process: int | None = None) -> None:
    """Remove the drafts that a process left in a folder because it was killed; by default those of every process.

    Raises
    ------
    OSError
        If one cannot be removed.
    """
    draft = re.compile(rf"\..+\.{r'[0-9]+' if process is None else process}\.draft")
    for file in folder.iterdir():
        if draft.fullmatch(file.name):
            file.unlink(missing_ok=True)
