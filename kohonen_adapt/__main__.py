"""Command ``kohonen-adapt``, also ``python -m kohonen_adapt``."""

import argparse
import logging
import os
import shlex
import sys
import warnings
from collections import ChainMap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from skfem import Mesh

from kohonen_adapt import __doc__ as description
from kohonen_adapt.cases.case import Case
from kohonen_adapt.cases.checking import fitting_mesh
from kohonen_adapt.cases.readers import locate_errors
from kohonen_adapt.cases.reading import read_case
from kohonen_adapt.cases.template import case_text
from kohonen_adapt.commands.arguments import command_parser, options_of, options_text, writable_folder
from kohonen_adapt.commands.check import described, faults, held_described, hints_of_mesh, moving, points_described
from kohonen_adapt.commands.pictures import write_overview, write_pictures
from kohonen_adapt.commands.plan import case_doubts, coil_sentences, plan_lines, unit_doubts
from kohonen_adapt.commands.relocate import relocate_file
from kohonen_adapt.commands.run import CaseRun, curve_sentence, results_of, write_fields
from kohonen_adapt.commands.sweep import sweep_case
from kohonen_adapt.commands.terminal import Terminal, drawn, let_signals_end_the_process, without_broken_pipes
from kohonen_adapt.display import counted
from kohonen_adapt.files import remove_drafts, whole_file
from kohonen_adapt.io import read_groups, read_mesh
from kohonen_adapt.loop.adapt import adapt
from kohonen_adapt.loop.figures import energy_norm_error, estimate_word, goal_sentence, values_of
from kohonen_adapt.loop.passes import Status
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.magnetostatics.bracketing import bracket_of
from kohonen_adapt.magnetostatics.scalar_potential import MagneticScalarPotential
from kohonen_adapt.mesh.cells import check_kind
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.validity import check_mesh
from kohonen_adapt.problem.protocol import CheckedProblem
from kohonen_adapt.report.summary import bracket_sentences
from kohonen_adapt.version import __version__

__all__ = ["main"]

PACKAGE = Path(__file__).parent
# A wheel contains the examples; in a source tree they are in the parent folder of the package.
EXAMPLES = (PACKAGE / "data", PACKAGE.parent / "examples")

DONE, FAILED, WRONG_USE = 0, 1, 2


@without_broken_pipes()
def main(argv: Sequence[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    argv
        Arguments, by default those of the process: then Ctrl-C and SIGTERM end the process at once.

    Returns
    -------
    int
        0 for success, 1 if the problem could not be solved or `check` found faults, 2 for wrong arguments and files
        that cannot be read or written.

    Raises
    ------
    SystemExit
        If argparse ends the process: with 0 after ``--help`` and ``--version``, with 2 for unknown arguments and, after
        the help, without arguments.
    """
    if argv is None:
        let_signals_end_the_process()
    parser = command_parser(description, __version__, HANDLERS)
    arguments = parser.parse_args(argv)
    if arguments.command is None:
        parser.exit(WRONG_USE, parser.format_help())
    quiet = getattr(arguments, "quiet", False)
    terminal = Terminal(quiet)
    if "renamed" in arguments:
        terminal.complain(f"warning: {arguments.renamed}")
    logging.basicConfig(format="%(message)s", level=logging.WARNING, handlers=[terminal])
    logging.getLogger("kohonen_adapt").setLevel(logging.WARNING if quiet else logging.INFO)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = terminal.warn
            return arguments.run(arguments, terminal)
    except (OSError, ValueError) as error:
        terminal.complain(error)
        return FAILED if isinstance(error, np.linalg.LinAlgError) else WRONG_USE


def _demo(arguments: argparse.Namespace, terminal: Terminal) -> int:
    folder, name = writable_folder(arguments.out), arguments.name
    mesh_file, fields, picture, report = (folder / f"{name}.{kind}" for kind in ("msh", "vtu", "png", "html"))
    remove_drafts(folder)
    case = read_case(_example(f"{name}.toml"))
    mesh, passes = fitting_mesh(case), _Passes(terminal, case.most_passes)
    after = adapt(
        mesh, case.problem, outputs=case.labelled_outputs, interim=passes.report, progress=passes.show, **case.adapt
    )
    terminal.say(after)
    write_fields(case, after, mesh_file, fields)
    before, command = passes.before or after, f"kohonen-adapt demo {name}"
    drawn(terminal, folder, lambda: write_overview(case, before, after, picture, report, command))
    terminal.say(f"Files in {folder}: {', '.join(sorted(file.name for file in folder.glob(f'{name}.*')))}.")
    return FAILED if after.status is Status.FAILED else DONE


def _run(arguments: argparse.Namespace, terminal: Terminal) -> int:
    options = options_of(arguments)
    case, text = read_case(arguments.case, options), options_text(options)
    if arguments.out is None and arguments.resume is None and not arguments.dry_run:
        raise ValueError("run expected --out DIR (folder for the results), --resume DIR or --dry-run.")
    mesh = _read_mesh(case, arguments.case, terminal)
    if arguments.dry_run:
        return _say_plan(case, mesh, arguments.case, terminal)
    folder = writable_folder(arguments.out) if arguments.resume is None else arguments.resume
    passes = _Passes(terminal, case.most_passes)
    run = CaseRun(case, mesh, folder, progress=passes.show, report=passes.report)
    if finished := run.begin(resume=arguments.resume is not None, force=arguments.force):
        terminal.say(f"Continuing after pass {finished - 1}, the last finished pass in {folder}.")
    resume = ["kohonen-adapt", "run", str(arguments.case), *text, "--resume", str(folder)]
    terminal.say(f"The best pass so far is always in {folder}. To continue after an interruption: {shlex.join(resume)}")
    terminal.say(*plan_lines(case, mesh))
    result = run.result()
    terminal.say(result)
    # a resumed run has only the meshes
    before = passes.before or adapt(mesh, CheckedProblem(case.problem).at_grading_order, passes=0)
    failed, bracket = result.status is Status.FAILED, None
    if case.bracket and isinstance(case.problem, MagneticScalarPotential) and not failed:
        bracket = bracket_of(case.problem, result.solution)
    pictures = drawn(terminal, folder, lambda: write_pictures(case, before, result, folder, text, bracket))
    terminal.say(f"Files in {folder}: {', '.join([*results_of(result), *(pictures or [])])}.")
    terminal.say(goal_sentence(result.best), *bracket_sentences(bracket), curve_sentence(case, result))
    if failed:
        terminal.complain(result.message)
    terminal.repeat_warnings()
    return FAILED if failed else DONE


def _read_mesh(case: Case, path: Path, terminal: Terminal) -> Mesh:
    terminal.show("read")
    with locate_errors(path):
        mesh = fitting_mesh(case)
    for doubt in case_doubts(case, mesh):
        terminal.warn(doubt)
    return mesh


def _say_plan(case: Case, mesh: Mesh, path: Path, terminal: Terminal) -> int:
    found = f"{counted(len(terminal.warnings), 'warning')}, see above" if terminal.warnings else "no faults found"
    terminal.say(f"{path}: {found}; '{case.mesh}' has {mesh.nvertices} nodes.")
    terminal.say(*coil_sentences(case), *plan_lines(case, mesh))
    return DONE


@dataclass
class _Passes:
    terminal: Terminal
    passes: int
    known: str = ""
    before: AdaptResult | None = None

    def show(self, number: int, step: str) -> None:
        place = f"pass {number} of {self.passes}" if number <= self.passes else f"pass {number}"
        self.terminal.show(f"{place}: {step}{self.known and f', {self.known}'}")

    def report(self, result: AdaptResult) -> None:
        step = result.history[-1]
        if step.number == 0:
            self.before = result
        error = energy_norm_error(step)
        share = "" if error is None else f" ({error:.2f} %)"
        order = f" of order {step.order}" if step.order != result.history[0].order else ""
        self.known = f"{step.mesh.nvertices} nodes{order}, {estimate_word([step])} {step.estimate_text}{share}"
        relative = {name: value.relative_error for name, value in values_of(step).items() if name in step.outputs}
        errors = "".join(f", error of {name} {abs(each):.2g} %" for name, each in relative.items() if each is not None)
        compiling = f" and {step.compile_seconds:.0f} s of compiling" if step.compile_seconds >= 1.0 else ""
        self.terminal.say(f"pass {step.number}: {self.known}{errors}, {sum(step.seconds.values()):.2f} s{compiling}")


def _init(arguments: argparse.Namespace, terminal: Terminal) -> int:
    path = arguments.out or arguments.mesh.with_suffix(".toml")
    if path.exists():
        raise FileExistsError(f"init does not overwrite '{path}'; choose another name with -o CASE.toml.")
    mesh, groups = read_mesh(arguments.mesh, scale=arguments.scale), read_groups(arguments.mesh)
    check_kind(mesh)
    for doubt in unit_doubts(mesh, arguments.scale):
        terminal.warn(doubt)
    with whole_file(path) as draft:
        file = Path(os.path.relpath(arguments.mesh.resolve(), path.parent.resolve())).as_posix()
        draft.write_text(case_text(mesh, file, arguments.scale, points=groups.places), encoding="utf-8")
    terminal.say(f"Wrote {path}. Fill in its materials and potential, then: kohonen-adapt run {path} --dry-run")
    return DONE


def _check(arguments: argparse.Namespace, terminal: Terminal) -> int:
    if arguments.mesh.suffix.lower() == ".toml":
        if arguments.nodes or arguments.surfaces or arguments.scale != 1.0:
            raise ValueError("--nodes, --surfaces and --scale are for meshes; a case has its own scale and surfaces.")
        case = read_case(arguments.mesh)
        return _say_plan(case, _read_mesh(case, arguments.mesh, terminal), arguments.mesh, terminal)
    mesh = read_mesh(arguments.mesh, scale=arguments.scale)
    check_mesh(mesh, inverted=True)
    corners = corners_of(mesh)
    groups = read_groups(arguments.mesh, scale=arguments.scale)
    terminal.say(*described(corners), *points_described(groups))
    found = list(faults(corners))
    surfaces = dict(ChainMap(*arguments.surfaces))
    lines, hinted = moving(mesh, surfaces)
    terminal.say(*lines, *(f"hint: {hint}" for hint in (*hints_of_mesh(corners, arguments.scale), *hinted)))
    if arguments.nodes:
        terminal.say(*held_described(mesh, surfaces))
    terminal.say(*(f"- {fault}" for fault in found))
    terminal.say(f"{counted(len(found), 'fault')} found." if found else "No faults found.")
    return FAILED if found else DONE


def _example(name: str) -> Path:
    for folder in EXAMPLES:
        if (folder / name).is_file():
            return folder / name
    raise FileNotFoundError(f"the example '{name}' is missing in {EXAMPLES[0]}. Install kohonen-adapt again.")


HANDLERS = {
    "demo": _demo,
    "run": _run,
    "init": _init,
    "check": _check,
    "relocate": relocate_file,
    "sweep": sweep_case,
}


if __name__ == "__main__":
    sys.exit(main())
