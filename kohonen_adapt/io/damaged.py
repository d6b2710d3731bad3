"""The one line that is said of a file that cannot be read."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["refusing"]

SHOWN = 160  # characters of what went wrong: a file may put anything there


@contextmanager
def refusing(path: Path, message: str) -> Iterator[None]:
    """Turn what goes wrong inside, while a file is taken apart, into a ValueError of one line that names it.

    Parameters
    ----------
    path
        The file.
    message
        The line, with ``{}`` where it says what went wrong.
    """
    try:
        yield
    except MemoryError:
        raise ValueError(f"'{path}' does not fit into memory.") from None
    except (ArithmeticError, LookupError, SyntaxError, TypeError, ValueError) as error:
        said = f"{error.args[0]} is missing" if isinstance(error, KeyError) else str(error)
        line = "".join(sign if sign.isprintable() else " " for sign in said[: 2 * SHOWN])
        raise ValueError(message.format(line if len(said) <= SHOWN else f"{line[:SHOWN]}...")) from error
