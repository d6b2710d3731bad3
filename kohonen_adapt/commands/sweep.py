"""Adaptation of a case for many values of its keys."""

import argparse
import json
import re
import shlex
import tomllib
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np

from kohonen_adapt.cases.case import Case
from kohonen_adapt.cases.checking import fitting_mesh
from kohonen_adapt.cases.drawing import Drawing
from kohonen_adapt.cases.readers import locate_errors
from kohonen_adapt.cases.reading import case_of, read_case, with_options
from kohonen_adapt.commands.arguments import check_resumed, options_of, options_text, writable_folder
from kohonen_adapt.commands.plan import plan_sentence
from kohonen_adapt.commands.terminal import Terminal, drawn
from kohonen_adapt.files import remove_drafts, save_figure, write_whole
from kohonen_adapt.loop.adapt import adapt
from kohonen_adapt.loop.figures import with_unit
from kohonen_adapt.loop.settings import Tolerance
from kohonen_adapt.precompile import compile_missing
from kohonen_adapt.sweeps.cases import ASKED, ERROR, SECONDS, SweepResult
from kohonen_adapt.sweeps.pool import LocalPool
from kohonen_adapt.sweeps.sweep import sweep

__all__ = ["sweep_case"]

TABLE, PICTURE = "sweep.csv", "sweep.png"
SUMMARY = "sweep.json"
STATUS, MISSED = "status", "missed"  # columns
CASES = "cases"  # subfolder of the finished cases

OVER = re.compile(r"(.+)=([^=:]+):([^=:]+):([^=:]+)")


@dataclass(frozen=True)
class CaseOutputs:
    """Outputs of a case as a function of some of its keys, for other processes.

    Attributes
    ----------
    file
        The case; paths in it are relative to its folder.
    text
        Text of the case.
    mesh
        Digest of its mesh file and drawing, because a sweep of another mesh is another sweep.
    options
        Keys of ``adapt`` that replace those of the case.
    """

    file: Path
    text: str
    mesh: str
    options: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, path: Path, options: dict[str, Any] | None = None) -> "CaseOutputs":
        case = read_case(path, options)
        if not case.outputs:
            raise ValueError(f"{path}: sweep expected [outputs], the quantities to tabulate; the case has none.")
        with locate_errors(path):
            files = [case.mesh_file, *sorted(case.mesh_file.glob("mesh.*"))]  # several in a folder of Elmer
        files += [case.mesh.file] if isinstance(case.mesh, Drawing) else []
        content = b"".join(file.read_bytes() for file in files if file.is_file())
        return cls(path.resolve(), case.text, blake2b(content, digest_size=16).hexdigest(), options or {})

    def __call__(self, **values: float) -> dict[str, float | str]:
        case = self.case(values)
        mesh = fitting_mesh(case)
        options = case.options(mesh)
        result = adapt(mesh, case.problem, outputs=case.labelled_outputs, **options)
        if result.error:
            raise result.error
        tolerance = Tolerance(**{each.name: options.get(each.name) for each in fields(Tolerance)})
        best = result.best
        # errors that are not known, or not limited, are left out
        found, asked = dict[str, float | str](), tolerance.of_values(best)
        for name, each in result.outputs.items():
            label = with_unit(name, best) if name == "goal" else name
            found[label] = each.value
            found |= {} if each.error is None else {f"{ERROR}{label}": each.error}
            found |= {f"{ASKED}{label}": asked[name]} if name in asked else {}
        return found | {STATUS: result.status.value, MISSED: ", ".join(tolerance.missed(best))}

    def case(self, values: Mapping[str, float]) -> Case:
        given = with_options(tomllib.loads(self.text), self.options)
        for name, value in values.items():
            given = _merged(given, _table(name, value))
        return case_of(given, self.file.parent)


def sweep_case(arguments: argparse.Namespace, terminal: Terminal) -> int:
    if arguments.out is None and arguments.resume is None:
        raise ValueError("sweep expected --out DIR (folder for the results) or --resume DIR.")
    options = options_of(arguments)
    outputs, grid = CaseOutputs.of(arguments.case, options), dict(map(_values, arguments.over))
    terminal.show("read")
    start = outputs.case({name: values[0] for name, values in grid.items()})
    with locate_errors(arguments.case):
        mesh = fitting_mesh(start)
    folder = _begun(arguments)
    over = [f"--over={each}" for each in arguments.over]
    command = ["kohonen-adapt", "sweep", str(arguments.case), *over, *options_text(options)]
    terminal.say(f"To continue after an interruption: {shlex.join([*command, '--resume', str(folder)])}")
    terminal.say(plan_sentence(start, mesh).replace("Plan", "Plan of every case", 1))

    def show_progress(done: int, count: int) -> None:
        terminal.show(f"{done} of {count} cases")

    with _executor(arguments) as executor:
        result = sweep(outputs, grid, executor=executor, folder=folder / CASES, progress=show_progress)
    result.to_csv(folder / TABLE)
    write_whole(folder / SUMMARY, json.dumps([*records(result)], indent=1).encode())
    terminal.say(result)
    picture = drawn(terminal, folder, lambda: _draw(result, folder), "the picture")
    terminal.say(f"Files in {folder}: {', '.join([TABLE, SUMMARY, *(picture or [])])}.")
    failed, count = sum(error is not None for error in result.errors), len(result.errors)
    every = result.table[MISSED].tolist() if MISSED in result.outputs else []  # in no row if every case failed
    if missed := [f"case {number} ({each})" for number, each in enumerate(every) if each]:
        terminal.warn(f"{len(missed)} of {count} cases missed a tolerance: {'; '.join(missed)}.")
    if failed:
        terminal.complain(f"{failed} of {count} cases failed; --resume tries them again.")
    return int(failed > 0)


def records(result: SweepResult) -> Iterator[dict[str, Any]]:
    for values, error in zip(result.table.tolist(), result.errors, strict=True):
        record = zip([*result.parameters, *result.outputs, SECONDS], values, strict=True)
        known = {name: value for name, value in record if not (isinstance(value, float) and np.isnan(value))}
        yield known | ({} if error is None else {"error": f"{type(error).__name__}: {error}"})


def _draw(result: SweepResult, folder: Path) -> list[str]:
    from kohonen_adapt.plotting import sweep_figure  # needs matplotlib

    if not set(result.outputs) - {STATUS, MISSED}:
        return []
    save_figure(folder / PICTURE, sweep_figure(result))
    return [PICTURE]


def _begun(arguments: argparse.Namespace) -> Path:
    folder: Path = arguments.resume or writable_folder(arguments.out)
    cases = folder / CASES
    stopped_early = folder.is_dir() and not any(folder.iterdir())  # before the first case
    check_resumed(cases, arguments.resume and not stopped_early, "sweep")
    remove_drafts(folder)  # of killed processes
    if cases.is_dir() and not arguments.resume:
        if any(cases.glob("case-*.json")) and not (folder / TABLE).exists():
            raise FileExistsError(
                f"'{folder}' has cases of an unfinished sweep: continue with --resume {folder}, or delete '{cases}' to "
                "start anew."
            )
        # the table last, because a folder with a table is a finished sweep
        for file in [*sorted(cases.glob("*.json")), folder / TABLE]:
            file.unlink(missing_ok=True)
    return folder


@contextmanager
def _executor(arguments: argparse.Namespace) -> Iterator[Executor]:
    if not arguments.scheduler:
        with LocalPool(compile_missing, arguments.jobs) as pool:
            yield pool
        return
    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise ValueError('--scheduler needs Dask: pip install "kohonen-adapt[sweep]".') from None
    with Client(arguments.scheduler) as client:
        yield client.get_executor()


def _values(over: str) -> tuple[str, list[float]]:
    """Return name and values of ``NAME=FIRST:LAST:COUNT``, as integers if all are."""
    try:
        name, first, last, count = OVER.fullmatch(over).groups()  # type: ignore[union-attr]
        if not np.isfinite([float(first), float(last)]).all() or int(count) < 1:
            raise ValueError("no values")
        values = np.linspace(float(first), float(last), int(count))
    except (AttributeError, ValueError):
        raise ValueError(
            f"--over expected NAME=FIRST:LAST:COUNT, as materials.coil.current_density=0:2e6:11; got '{over}'."
        ) from None
    _table(name, 0)
    counted = re.fullmatch(r"[+-]?\d+", first) and re.fullmatch(r"[+-]?\d+", last) and (values == values.round()).all()
    return name, (values.astype(int) if counted else values).tolist()


def _table(name: str, value: float) -> dict[str, Any]:
    try:
        return tomllib.loads(f"{name} = {value!r}")
    except tomllib.TOMLDecodeError:
        raise ValueError(
            f"--over expected a dotted key of the case; got '{name}'. Keys with special characters need quotes."
        ) from None


def _merged(table: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    ((key, value),) = changes.items()
    if isinstance(value, Mapping):
        below = table.get(key, {})
        if not isinstance(below, Mapping):
            raise ValueError(
                f"--over expected a key of the case; '{key}' is {below!r} in the case, and has no key '{min(value)}'."
            )
        value = _merged(below, value)
    return {**table, key: value}
