"""The command ``kohonen-adapt``: what it does, what it says, and how it ends."""

import argparse
import logging
import os
import runpy
import shlex
import sys
import tempfile
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from skfem import MeshTri

from kohonen_adapt.cases import case_text, read_case
from kohonen_adapt.cases.kinds import about
from kohonen_adapt.commands.arguments import command_parser
from kohonen_adapt.commands.check import faults, thin_parts, unit_doubts
from kohonen_adapt.commands.description import described, outlines_described
from kohonen_adapt.commands.relocate import MEANINGS, STEPS, field_source, relocate_file
from kohonen_adapt.commands.results import RESULTS, write_pictures
from kohonen_adapt.commands.run import CaseRun
from kohonen_adapt.commands.terminal import Interrupted, LineHandler, Terminal
from kohonen_adapt.files import whole_file
from kohonen_adapt.io import read_mesh
from kohonen_adapt.loop.adapt import PASSES, adapt
from kohonen_adapt.loop.result import AdaptResult, Pass, Status
from kohonen_adapt.mesh.measures import quality
from kohonen_adapt.mesh.validity import check_mesh
from kohonen_adapt.som.kohonen_map import KohonenMap

__all__ = ["main"]

PACKAGE = Path(__file__).parents[1]
# The examples come along in a wheel; in a source tree they stand beside the package.
EXAMPLES = (PACKAGE / "data", PACKAGE.parent / "examples")

PLOT_REMEDY = 'For the picture: pip install "kohonen-adapt[plot]" and run this again.'

DONE, FAILED, WRONG_USE, INTERRUPTED = 0, 1, 2, 130

Drawn = TypeVar("Drawn")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    argv
        Arguments, by default those of the process.

    Returns
    -------
    int
        0 if all went well, 1 if the problem could not be solved or `check` found faults, 2 for wrong arguments and
        files that cannot be read or written, 130 for Ctrl-C. Where that, or SIGTERM (143), comes while a thread is at
        work, the process ends with that number, or while it draws by that signal, and nothing is returned.

    Raises
    ------
    SystemExit
        Where argparse ends the process: 0 after ``--help`` and ``--version``, 2 for arguments it does not know, and
        without any, after the help.
    """
    commands = {"demo": _demo, "run": _run, "init": _init, "check": _check, "relocate": _relocate}
    parser = command_parser(sys.modules[__package__].__doc__, commands)
    arguments = parser.parse_args(argv)
    if arguments.command is None:
        parser.exit(WRONG_USE, parser.format_help())
    quiet = getattr(arguments, "quiet", False)
    terminal = Terminal(quiet)
    logging.basicConfig(format="%(message)s", level=logging.WARNING, handlers=[LineHandler()])
    logging.getLogger(__package__).setLevel(logging.WARNING if quiet else logging.INFO)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = terminal.warn
            return terminal.wait_for(lambda: arguments.run(arguments, terminal))
    except np.linalg.LinAlgError as error:
        terminal.complain(error)
        return FAILED
    except (OSError, ValueError) as error:
        terminal.complain(error)
        return WRONG_USE
    except Interrupted as interrupt:
        terminal.leave(interrupt)
    except KeyboardInterrupt:
        terminal.complain("interrupted.")
        return INTERRUPTED


def _demo(arguments: argparse.Namespace, terminal: Terminal) -> int:
    """Run an example step by step, so that its files are there even if there can be no picture."""
    folder = _writable(arguments.out)
    terminal.writes_to(folder)
    example = runpy.run_path(str(_example(f"{arguments.name}.py")))
    passes = _Passes(terminal, example["PASSES"])
    before, after = example["adapt"](callback=passes.report, progress=passes.show)
    terminal.say(after)
    example["write"](after, folder)
    passes.draw()
    _drawn(terminal, folder, lambda: example["draw"](before, after, folder))
    files = sorted(file.name for file in folder.glob(f"{arguments.name}.*"))
    terminal.say(f"Files in {folder}: {', '.join(files)}.")
    return FAILED if after.status is Status.FAILED else DONE


def _run(arguments: argparse.Namespace, terminal: Terminal) -> int:
    """Adapt a case; its files are there even if there can be no picture."""
    case = read_case(arguments.case)
    if arguments.out is None and arguments.resume is None and not arguments.dry_run:
        raise ValueError("run expected --out DIR, the folder for the files, --resume DIR, or --dry-run.")
    passes = _Passes(terminal, case.adapt.get("passes", PASSES))
    terminal.show("read", 0, passes.passes + 1)
    with about(arguments.case):
        mesh = case.fitting_mesh()
    _doubt(mesh, terminal)
    if arguments.dry_run:
        terminal.say(f"{arguments.case}: nothing is wrong; '{case.mesh}' has {mesh.p.shape[1]} nodes.")
        return DONE
    folder = _writable(arguments.out) if arguments.resume is None else arguments.resume
    told = _Told(arguments.case, folder, passes)
    run = CaseRun(case, mesh, folder, progress=passes.show, told=told)
    finished = run.go_on() if arguments.resume else run.start_anew()
    terminal.writes_to(folder)
    terminal.writes_to(run.passes)
    if finished:
        terminal.say(f"Going on after pass {finished - 1}, the last that was finished in {folder}.")
    terminal.hint(told.hint())
    result = run.result()
    terminal.say(result)
    passes.draw()
    before = run.before or adapt(mesh, case.problem, passes=0)
    pictures = _drawn(terminal, folder, lambda: write_pictures(case, before, result, folder))
    terminal.say(f"Files in {folder}: {', '.join([*RESULTS, *(pictures or [])])}.")
    if result.status is Status.FAILED:
        terminal.complain(result.message)
        return FAILED
    return DONE


@dataclass
class _Passes:
    """Shows what pass and what step a loop is in, and reports finished passes."""

    terminal: Terminal
    passes: int
    known: str = ""

    def show(self, number: int, step: str) -> None:
        self.terminal.show(f"pass {number} of {self.passes}: {step}", number, self.passes + 1, self.known)

    def draw(self) -> None:
        self.terminal.show("draw", self.passes + 1, self.passes + 1, self.known)

    def report(self, step: Pass) -> None:
        share = f" ({100.0 * step.estimate / step.energy_norm:.2f} %)" if step.energy_norm else ""
        self.known = f"{step.mesh.p.shape[1]} nodes, estimate {step.estimate:.4g}{share}"
        self.terminal.say(f"pass {step.number}: {self.known}, {sum(step.seconds.values()):.2f} s")


@dataclass(frozen=True)
class _Told:
    """Reports the passes of a run, and what an interruption leaves of it."""

    case: Path
    folder: Path
    passes: _Passes

    def __call__(self, result: AdaptResult) -> None:
        self.passes.report(result.history[-1])
        best = next(step.number for step in result.history if step.mesh is result.mesh)
        so_far = f"pass {best}, the best of {len(result.history)}, is in {self.folder}: {', '.join(RESULTS)}"
        self.passes.terminal.hint(self.hint(so_far))

    def hint(self, so_far: str = "no further pass was finished") -> str:
        command = shlex.join(["kohonen-adapt", "run", str(self.case), "--resume", str(self.folder)])
        return f"{so_far}. To go on: {command}"


def _init(arguments: argparse.Namespace, terminal: Terminal) -> int:
    """Write a case; one that is there may hold work, so it stays."""
    path = arguments.output or arguments.mesh.with_suffix(".toml")
    if path.exists():
        raise FileExistsError(f"init does not overwrite '{path}'; choose another name with -o CASE.toml.")
    mesh = read_mesh(arguments.mesh, scale=arguments.scale)
    _doubt(mesh, terminal)
    with whole_file(path) as draft:
        file = Path(os.path.relpath(arguments.mesh.resolve(), path.parent.resolve())).as_posix()
        draft.write_text(case_text(mesh, file, arguments.scale), encoding="utf-8")
    terminal.say(f"Wrote {path}. Fill in its materials and potential, then: kohonen-adapt run {path} --dry-run")
    return DONE


def _check(arguments: argparse.Namespace, terminal: Terminal) -> int:
    """Describe a mesh, and fail if it has faults; what is refused anyhow ends the description with an error."""
    mesh = read_mesh(arguments.mesh, scale=arguments.scale)
    check_mesh(mesh)
    terminal.say("\n".join(described(mesh)))
    found = list(faults(mesh))
    som = KohonenMap(mesh)
    terminal.say("\n".join(outlines_described(som)))
    found += thin_parts(som)
    terminal.say("\n".join(f"- {fault}" for fault in found) or "Nothing is wrong.")
    return FAILED if found else DONE


def _relocate(arguments: argparse.Namespace, terminal: Terminal) -> int:
    """Relocate a mesh from file to file."""
    terminal.writes_to(_writable(arguments.out.parent))
    meaning, text = next((key, text) for key in MEANINGS if (text := getattr(arguments, key)) is not None)
    before, after = relocate_file(
        arguments.mesh,
        field_source(text, f"--{meaning}"),
        arguments.out,
        scale=arguments.scale,
        meaning=meaning,
        topology=arguments.topology,
        min_quality=arguments.min_quality,
        pinned=[_number_or_name(word) for word in arguments.pinned],
        seed=arguments.seed,
        periodic=[(one, other) for one, other in arguments.periodic],
        layers={name: _number_or_name(count) for name, count in arguments.layers} or None,
        progress=lambda number, step: terminal.show(step, number, len(STEPS)),
    )
    worst = [f"{quality(mesh).min():.2f}" for mesh in (before, after)]
    terminal.say(f"Wrote {arguments.out}: {after.p.shape[1]} nodes, worst quality {worst[1]}; before {worst[0]}.")
    return DONE


def _doubt(mesh: MeshTri, terminal: Terminal) -> None:
    """A mesh in millimetres that is taken for metres runs well and gives nonsense."""
    for doubt in unit_doubts(mesh):
        terminal.complain(f"warning: {doubt}")


def _number_or_name(word: str) -> Any:
    return int(word) if word.isdecimal() else word


def _drawn(terminal: Terminal, folder: Path, draw: Callable[[], Drawn]) -> Drawn | None:
    """What the drawing gives, or None without matplotlib; everything else is written by then."""
    terminal.say(f"Results are in {folder}; now pictures and the report, which Ctrl-C leaves out.")
    terminal.leave_signals()
    try:
        return draw()
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "matplotlib":
            raise
        terminal.say(PLOT_REMEDY)
        return None


def _writable(folder: Path) -> Path:
    """Create the folder and see that it takes files, before the work and not after it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        raise OSError(f"--out expected a folder that takes files; '{folder}' does not: {error.strerror}.") from error


def _example(name: str) -> Path:
    for folder in EXAMPLES:
        if (folder / name).is_file():
            return folder / name
    raise FileNotFoundError(f"the example '{name}' is not installed; expected it in {EXAMPLES[0]}. Install it again.")
