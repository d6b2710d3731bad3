"""The command ``kohonen-adapt``: its arguments, and what it says: progress and errors in plain lines."""

import argparse
import logging
import os
import runpy
import sys
import tempfile
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from skfem import MeshTri

from . import __version__
from .cases import Case, case_text, read_case
from .cases.kinds import about
from .commands.description import described, outlines_described
from .commands.faults import faults, thin_parts
from .commands.moving import MEANINGS, field_source, relocate_file
from .commands.results import write_pictures, write_results
from .io import read_mesh
from .io.whole_file import whole_file
from .loop import adapt
from .relocation import TOPOLOGIES
from .result import AdaptResult, Pass, Status
from .som import KohonenMap
from .triangles import quality
from .triangulation import check_mesh

__all__ = ["main"]

PACKAGE = Path(__file__).parent
# The examples come along in a wheel; in a source tree they stand beside the package.
EXAMPLES = (PACKAGE / "data", PACKAGE.parent / "examples")

PLOT_REMEDY = 'For the picture: pip install "kohonen-adapt[plot]" and run this again.'

DONE, FAILED, WRONG_USE, INTERRUPTED = 0, 1, 2, 130


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
        files that cannot be read or written, 130 for Ctrl-C.

    Raises
    ------
    SystemExit
        Where argparse ends the process: 0 after ``--help`` and ``--version``, 2 for arguments it does not know.
    """
    arguments = _parser().parse_args(argv)
    logging.basicConfig(format="%(message)s", level=logging.WARNING)
    quiet = getattr(arguments, "quiet", False)
    logging.getLogger(__package__).setLevel(logging.WARNING if quiet else logging.INFO)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _warn
            return arguments.run(arguments)
    except np.linalg.LinAlgError as error:
        print(f"kohonen-adapt: {error}", file=sys.stderr)
        return FAILED
    except (OSError, ValueError) as error:
        print(f"kohonen-adapt: {error}", file=sys.stderr)
        return WRONG_USE
    except KeyboardInterrupt:
        print("kohonen-adapt: interrupted.", file=sys.stderr)
        return INTERRUPTED


def _warn(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """A warning in one line, in place of `warnings.showwarning`: where in the code it arose helps nobody here."""
    print(f"kohonen-adapt: warning: {message}", file=sys.stderr)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="kohonen-adapt", description=sys.modules[__package__].__doc__)
    parser.add_argument("--version", action="version", version=f"kohonen-adapt {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    demo = commands.add_parser("demo", help="adapt an example and write its files")
    demo.add_argument("name", choices=["magnet"], help="magnet: a permanent magnet in an iron core with an air gap")
    demo.add_argument("--out", metavar="DIR", type=Path, required=True, help="folder for the files; created if missing")
    demo.set_defaults(run=_demo)
    _add_run(commands)
    _add_init(commands)
    _add_check(commands)
    _add_relocate(commands)
    return parser


def _add_relocate(commands: Any) -> None:
    move = commands.add_parser(
        "relocate",
        help="move the nodes of a mesh to where a field wants them, for any solver",
        description="Move the nodes of a mesh to where a field wants them. Physical groups keep names and numbers, and "
        "points in a group their place. The field is one number per element or node of MESH: of a VTU file, a .msh "
        "with NodeData, ElementData or ElementNodeData, or a .pos of GetDP (Print[..., OnElementsOf ...]).",
    )
    move.add_argument("mesh", metavar="MESH", type=Path, help="a Gmsh or VTU file")
    field = move.add_mutually_exclusive_group(required=True)
    field.add_argument("--density", metavar="FIELD.vtu:name", help="wanted nodes per area, on any scale")
    field.add_argument("--indicators", metavar="FIELD.vtu:name", help="error of each element, in the energy norm")
    field.add_argument("--sizes", metavar="FIELD.vtu:name", help="wanted edge lengths")
    move.add_argument("--out", metavar="MESH2", type=Path, required=True, help="a Gmsh or VTU file")
    move.add_argument("--topology", choices=TOPOLOGIES, default="flip", help="by default flip")
    move.add_argument("--min-quality", metavar="Q", type=float, default=0.3, help="of elements, by default 0.3")
    move.add_argument("--pinned", metavar="NAME", nargs="+", default=[], help="names and node numbers of what stays")
    move.add_argument("--periodic", metavar="NAME", nargs=2, action="append", default=[], help="a pair that matches")
    move.add_argument("--layers", metavar=("NAME", "K"), nargs=2, action="append", default=[], help="to keep across it")
    move.add_argument("--seed", metavar="N", type=int, default=0)
    move.add_argument("--quiet", action="store_true", help="say nothing but warnings and errors")
    move.set_defaults(run=_relocate)


def _add_check(commands: Any) -> None:
    check = commands.add_parser(
        "check",
        help="say what a mesh is, and what would go wrong with it",
        description="Say what a mesh is, and what would go wrong with it. The exit status is 0 if nothing would, 1 if "
        "faults were found, and 2 if the file holds no mesh at all.",
    )
    _add_mesh(check)
    check.set_defaults(run=_check)


def _add_init(commands: Any) -> None:
    init = commands.add_parser("init", help="write a commented case for a mesh, its names filled in")
    _add_mesh(init)
    init.add_argument("-o", "--output", metavar="CASE.toml", type=Path, help="by default beside the mesh")
    init.set_defaults(run=_init)


def _add_mesh(command: argparse.ArgumentParser) -> None:
    command.add_argument("mesh", metavar="MESH", type=Path, help="a Gmsh or VTU file")
    command.add_argument("--scale", metavar="S", type=float, default=1.0, help="metres per unit of it; 1e-3 for mm")


def _add_run(commands: Any) -> None:
    run = commands.add_parser("run", help="adapt the mesh of a case and write what comes of it")
    run.add_argument("case", metavar="CASE.toml", type=Path, help="mesh, materials, boundaries and options")
    run.add_argument("--out", metavar="DIR", type=Path, help="folder for the files; created if missing")
    run.add_argument("--dry-run", action="store_true", help="check the case and its mesh, solve and write nothing")
    run.add_argument("--quiet", action="store_true", help="say nothing but warnings and errors")
    run.set_defaults(run=_run)


def _demo(arguments: argparse.Namespace) -> int:
    """Run an example step by step, so that its files are there even if there can be no picture."""
    folder = _writable(arguments.out)
    example = runpy.run_path(str(_example(f"{arguments.name}.py")))
    before, after = example["adapt"](callback=_report)
    print(after)
    example["write"](after, folder)
    _draw(example, before, after, folder)
    print(f"Files in {folder}: {', '.join(sorted(file.name for file in folder.glob(f'{arguments.name}.*')))}.")
    return FAILED if after.status is Status.FAILED else DONE


def _run(arguments: argparse.Namespace) -> int:
    """Adapt a case; its files are there even if there can be no picture."""
    case = read_case(arguments.case)
    if not arguments.dry_run and arguments.out is None:
        raise ValueError("run expected --out DIR, the folder for the files, or --dry-run.")
    folder = None if arguments.dry_run else _writable(arguments.out)
    with about(arguments.case):
        mesh = case.fitting_mesh()
    say = _silent if arguments.quiet else print
    if folder is None:
        say(f"{arguments.case}: nothing is wrong; '{case.mesh}' has {mesh.p.shape[1]} nodes.")
        return DONE
    result = adapt(
        mesh,
        case.problem,
        callback=None if arguments.quiet else _report,
        outputs=case.outputs or None,
        **case.adapt,
    )
    say(result)
    files = write_results(case, result, folder) + _pictures(case, mesh, result, folder, say)
    say(f"Files in {folder}: {', '.join(files)}.")
    if result.status is Status.FAILED:
        print(f"kohonen-adapt: {result.message}", file=sys.stderr)
        return FAILED
    return DONE


def _pictures(case: Case, mesh: MeshTri, result: AdaptResult, folder: Path, say: Callable[[Any], None]) -> list[str]:
    try:
        return write_pictures(case, adapt(mesh, case.problem, passes=0), result, folder)
    except ModuleNotFoundError as error:
        _only_matplotlib(error)
        say(PLOT_REMEDY)
        return []


def _init(arguments: argparse.Namespace) -> int:
    """Write a case; one that is there may hold work, so it stays."""
    path = arguments.output or arguments.mesh.with_suffix(".toml")
    if path.exists():
        raise FileExistsError(f"init does not overwrite '{path}'; choose another name with -o CASE.toml.")
    mesh = read_mesh(arguments.mesh, scale=arguments.scale)
    with whole_file(path) as draft:
        file = Path(os.path.relpath(arguments.mesh.resolve(), path.parent.resolve())).as_posix()
        draft.write_text(case_text(mesh, file, arguments.scale), encoding="utf-8")
    print(f"Wrote {path}. Fill in its materials, then: kohonen-adapt run {path} --dry-run")
    return DONE


def _check(arguments: argparse.Namespace) -> int:
    """Describe a mesh, and fail if it has faults; what is refused anyhow ends the description with an error."""
    mesh = read_mesh(arguments.mesh, scale=arguments.scale)
    check_mesh(mesh)
    print("\n".join(described(mesh)))
    found = list(faults(mesh))
    som = KohonenMap(mesh)
    print("\n".join(outlines_described(som)))
    found += thin_parts(som)
    print("\n".join(f"- {fault}" for fault in found) or "Nothing is wrong.")
    return FAILED if found else DONE


def _relocate(arguments: argparse.Namespace) -> int:
    """Relocate a mesh from file to file."""
    _writable(arguments.out.parent)
    meaning, text = next((key, text) for key in MEANINGS if (text := getattr(arguments, key)) is not None)
    before, after = relocate_file(
        arguments.mesh,
        field_source(text, f"--{meaning}"),
        arguments.out,
        meaning=meaning,
        topology=arguments.topology,
        min_quality=arguments.min_quality,
        pinned=[_number_or_name(word) for word in arguments.pinned],
        seed=arguments.seed,
        periodic=[(one, other) for one, other in arguments.periodic],
        layers={name: _number_or_name(count) for name, count in arguments.layers} or None,
    )
    if not arguments.quiet:
        worst = [f"{quality(mesh).min():.2f}" for mesh in (before, after)]
        print(f"Wrote {arguments.out}: {after.p.shape[1]} nodes, worst quality {worst[1]}; before {worst[0]}.")
    return DONE


def _number_or_name(word: str) -> Any:
    return int(word) if word.isdecimal() else word


def _silent(said: Any) -> None:
    """What a command says that is to be quiet."""


def _report(step: Pass) -> None:
    share = f" ({100.0 * step.estimate / step.energy_norm:.2f} %)" if step.energy_norm else ""
    print(
        f"pass {step.number}: {step.mesh.p.shape[1]} nodes, estimate {step.estimate:.4g}{share}, "
        f"{sum(step.seconds.values()):.2f} s",
        flush=True,
    )


def _draw(example: dict[str, Any], before: AdaptResult, after: AdaptResult, folder: Path) -> None:
    try:
        example["draw"](before, after, folder)
    except ModuleNotFoundError as error:
        _only_matplotlib(error)
        print(PLOT_REMEDY)


def _only_matplotlib(error: ModuleNotFoundError) -> None:
    """Let nothing but a missing matplotlib pass."""
    if (error.name or "").partition(".")[0] != "matplotlib":
        raise error


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
