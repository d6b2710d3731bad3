"""A file that is written whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["whole_file"]


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
