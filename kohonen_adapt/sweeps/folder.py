"""Keep finished cases of a sweep as files, so that none is computed again."""

import json
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from os import PathLike
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

from kohonen_adapt.files import remove_drafts, whole_file
from kohonen_adapt.sweeps.cases import SECONDS, Case
from kohonen_adapt.sweeps.outcome import Outcome

__all__ = ["SweepFolder"]

FORMAT = 1  # of the files; another number is another format

ABOUT = "sweep.json"  # what the cases are of


@dataclass(frozen=True)
class SweepFolder:
    """A folder with a file for every finished case of one sweep.

    Attributes
    ----------
    folder
        Where the files are.
    """

    folder: Path

    @classmethod
    def at(cls, folder: str | PathLike[str], function: Callable[..., Any], cases: list[Case]) -> "SweepFolder":
        """Create the folder if need be, and see that what is in it belongs to this sweep.

        Raises
        ------
        ValueError
            If `folder` is no path, or holds another sweep.
        OSError
            If it cannot be created, read or written to.
        """
        if not isinstance(folder, str | PathLike):
            raise ValueError(f"folder must be the path of a folder, or None; got {folder!r}.")
        path, about = Path(folder), _about(function, cases)
        path.mkdir(parents=True, exist_ok=True)
        remove_drafts(path)  # of a process that was killed
        if (path / ABOUT).exists():
            _check(path, before=_read(path / ABOUT), now=about)
        else:
            _write(path / ABOUT, about)
        return cls(path)

    def finished(self, count: int) -> dict[int, Outcome]:
        """What came of those of the first cases that are there, by their numbers.

        Raises
        ------
        ValueError
            If a file is damaged.
        OSError
            If one cannot be read.
        """
        return {number: _outcome(file) for number in range(count) if (file := self._file(number)).exists()}

    def keep(self, number: int, outcome: Outcome) -> None:
        """Write what came of a case, whole or not at all.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        _write(self._file(number), {"outputs": outcome.outputs, SECONDS: outcome.seconds})

    def _file(self, number: int) -> Path:
        return self.folder / f"case-{number:04d}.json"


def _about(function: Callable[..., Any], cases: list[Case]) -> dict[str, Any]:
    """What a sweep is of, by the words of the error that another one gets."""
    name, content = _identity(function)
    return {
        "format": FORMAT,
        "function": name,
        "code or data of the function": sha256(content).hexdigest()[:32],
        "parameters": list(cases[0]),
        "values of parameters": [list(case.values()) for case in cases],
    }


def _identity(function: Callable[..., Any]) -> tuple[str, bytes]:
    """The name of a function and its code, or of any other callable the class and the data.

    What a function calls is not looked at.
    """
    kind = function if isinstance(function, FunctionType) else type(function)
    name = f"{kind.__module__}.{kind.__qualname__}"
    if isinstance(function, FunctionType):
        return name, _code(function.__code__).encode()
    try:
        return name, pickle.dumps(function)
    except Exception:  # an executor that needs no pickles may take it all the same
        return name, b""


def _code(code: CodeType) -> str:
    """What a function does, and neither where it stands nor its comments."""
    constants = [
        _code(each) if isinstance(each, CodeType) else sorted(map(repr, each)) if isinstance(each, frozenset) else each
        for each in code.co_consts
    ]
    return repr((code.co_code, code.co_names, constants))


def _check(folder: Path, before: dict[str, Any], now: dict[str, Any]) -> None:
    differing = [name for name in now if json.dumps(before.get(name)) != json.dumps(now[name])]
    if differing:
        raise ValueError(
            f"the folder '{folder}' is of another sweep: its {' and '.join(differing)} differ (it was begun with "
            f"{before.get('function')}, this is {now['function']}). Go on with what it was begun with, or choose "
            "another folder."
        )


def _outcome(file: Path) -> Outcome:
    given = _read(file)
    try:
        outputs = {name: float(value) for name, value in given["outputs"].items()}
        return Outcome(outputs, float(given[SECONDS]))
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise _damaged(file, error) from error


def _read(file: Path) -> dict[str, Any]:
    content = file.read_bytes()
    try:
        given = json.loads(content)
    except ValueError as error:
        raise _damaged(file, error) from error
    if not isinstance(given, dict):
        raise _damaged(file, TypeError("it holds no table"))
    return given


def _write(file: Path, content: dict[str, Any]) -> None:
    with whole_file(file) as draft:
        draft.write_text(json.dumps(content), encoding="utf-8")


def _damaged(file: Path, error: Exception) -> ValueError:
    return ValueError(f"'{file}' is damaged ({type(error).__name__}: {error}): delete it and compute that again.")
