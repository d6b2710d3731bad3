"""Files of the finished cases of a sweep, which a repeated sweep reads."""

import json
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from os import PathLike
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

from kohonen_adapt.arrays import FilePath
from kohonen_adapt.files import remove_drafts, write_whole
from kohonen_adapt.sweeps.cases import SECONDS, Case, Outcome

__all__ = ["SweepFolder"]

FORMAT = 1  # version of the files, to increase with each change of their format

ABOUT = "sweep.json"  # description of the sweep


@dataclass(frozen=True)
class SweepFolder:
    """Folder with one file for every finished case of a sweep.

    Attributes
    ----------
    folder
        Path of the folder.
    """

    folder: Path

    @classmethod
    def at(cls, folder: FilePath, function: Callable[..., Any], cases: list[Case]) -> "SweepFolder":
        if not isinstance(folder, str | PathLike):
            raise ValueError(f"folder must be the path of a folder, or None; got {folder!r}.")
        path, (name, content) = Path(folder), _identity(function)
        about = {
            "format": FORMAT,
            "function": name,
            "code or data of the function": sha256(content).hexdigest()[:32],
            "parameters": list(cases[0]),
            "values of parameters": [list(case.values()) for case in cases],
        }
        path.mkdir(parents=True, exist_ok=True)
        remove_drafts(path)  # left by a process that was killed
        if (path / ABOUT).exists():
            with _reading(path / ABOUT):
                before = dict(json.loads((path / ABOUT).read_bytes()))
            differing = [key for key in about if json.dumps(before.get(key)) != json.dumps(about[key])]
            if differing:
                raise ValueError(
                    f"the folder '{path}' is of another sweep: its {' and '.join(differing)} differ (it was begun with "
                    f"{before.get('function')}, this is {name}). Go on with what it was begun with, or choose another "
                    "folder."
                )
        else:
            _write(path / ABOUT, about)
        return cls(path)

    def finished(self, count: int) -> dict[int, Outcome]:
        return {number: _outcome(file) for number in range(count) if (file := self._file(number)).exists()}

    def keep(self, number: int, outcome: Outcome) -> None:
        _write(self._file(number), {"outputs": outcome.outputs, SECONDS: outcome.seconds})

    def _file(self, number: int) -> Path:
        return self.folder / f"case-{number:04d}.json"


def _identity(function: Callable[..., Any]) -> tuple[str, bytes]:
    kind = function if isinstance(function, FunctionType) else type(function)
    name = f"{kind.__module__}.{kind.__qualname__}"
    if isinstance(function, FunctionType):
        return name, _code(function.__code__).encode()
    try:
        return name, pickle.dumps(function)
    except Exception:  # threads run a callable that cannot be pickled, too
        return name, b""


def _code(code: CodeType) -> str:
    constants = [
        _code(each) if isinstance(each, CodeType) else sorted(map(repr, each)) if isinstance(each, frozenset) else each
        for each in code.co_consts
    ]
    return repr((code.co_code, code.co_names, constants))


def _outcome(file: Path) -> Outcome:
    with _reading(file):
        given = json.loads(file.read_bytes())
        outputs = {name: value if isinstance(value, str) else float(value) for name, value in given["outputs"].items()}
        return Outcome(outputs, float(given[SECONDS]))


def _write(file: Path, content: dict[str, Any]) -> None:
    write_whole(file, json.dumps(content).encode())


@contextmanager
def _reading(file: Path) -> Iterator[None]:
    try:
        yield
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise ValueError(f"'{file}' is damaged ({reason}): delete it and compute that again.") from error
