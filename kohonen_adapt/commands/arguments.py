"""Arguments of the command ``kohonen-adapt``."""

import argparse
import tempfile
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from kohonen_adapt.cases.kinds import table_of
from kohonen_adapt.cases.tables import surface
from kohonen_adapt.outline.rules import TOPOLOGIES, LeastQuality, Rules
from kohonen_adapt.outline.surfaces import Surface

__all__ = ["command_parser", "writable_folder"]

EPILOG = "For one of them: kohonen-adapt COMMAND --help. A first case: kohonen-adapt init MESH."

Handler = Callable[..., int]


def command_parser(description: str | None, version: str, run: Mapping[str, Handler]) -> argparse.ArgumentParser:
    """Return the parser of the command, with the handler of a subcommand as ``run``."""
    parser = argparse.ArgumentParser(prog="kohonen-adapt", description=description, epilog=EPILOG)
    parser.add_argument("--version", action="version", version=f"kohonen-adapt {version}")
    commands = parser.add_subparsers(metavar="COMMAND", dest="command")
    demo = commands.add_parser(
        "demo",
        help="adapt an example and write its files",
        description="Adapt an example that comes along, and write its mesh, fields, picture and report.",
    )
    demo.add_argument("name", choices=["magnet"], help="magnet: a permanent magnet in an iron core with an air gap")
    _add_folder(demo, required=True)
    _add_run(commands)
    _add_init(commands)
    _add_check(commands)
    _add_relocate(commands)
    _add_sweep(commands)
    for name, handler in run.items():
        commands.choices[name].set_defaults(run=handler)
    return parser


def _add_relocate(commands: Any) -> None:
    move = commands.add_parser(
        "relocate",
        help="move the nodes of a mesh to where a field wants them, for any solver",
        description="Move the nodes of a mesh to where a field wants them. Physical groups keep names and numbers, and "
        "points in a group their place. The field is one number per element or node of MESH: of a VTU file, a .msh "
        "with NodeData, ElementData or ElementNodeData, or a .pos of GetDP (Print[..., OnElementsOf ...]).",
    )
    move.add_argument(
        "mesh", metavar="MESH", type=Path, help="a mesh file of any kind that ka.read_mesh reads, or a folder of Elmer"
    )
    field = move.add_mutually_exclusive_group(required=True)
    field.add_argument("--density", metavar="FIELD.vtu:name", help="wanted nodes per area or volume, on any scale")
    field.add_argument(
        "--indicators", metavar="FIELD.vtu:name", help="error of each element in the energy norm, not squared"
    )
    field.add_argument("--sizes", metavar="FIELD.vtu:name", help="wanted edge lengths, in any unit")
    _add_file(move, "MESH2", "file (.msh, .msh2, .vtu) or folder of Elmer to write, in the unit of MESH", required=True)
    move.add_argument(
        "--scale",
        metavar="S",
        type=float,
        default=1.0,
        help="metres per unit of MESH, for a field file in metres; by default both are in one unit",
    )
    _add_limits(move)
    move.add_argument("--seed", metavar="N", type=int, default=0, help="of the random numbers, by default 0")
    move.add_argument("--quiet", action="store_true", help="say nothing but warnings and errors")


def _add_limits(move: argparse.ArgumentParser) -> None:
    move.add_argument(
        "--topology",
        choices=TOPOLOGIES,
        default=Rules.topology,
        help="fixed: nodes move; flip, the default: edges flip, too; recycle: nodes are taken away and put elsewhere",
    )
    move.add_argument(
        "--min-quality",
        metavar="Q",
        type=least_quality,
        default=Rules.min_quality,
        help="least quality of an element, from 0, flat, to 1, equilateral; auto, the default: 0.3",
    )
    move.add_argument("--pinned", metavar="NAME", nargs="+", default=[], help="names and node numbers of what stays")
    move.add_argument(
        "--periodic", metavar="NAME", nargs=2, action="append", default=[], help="two boundaries that stay matched"
    )
    move.add_argument(
        "--layers",
        metavar=("NAME", "K"),
        nargs=2,
        action="append",
        default=[],
        help="a thin subdomain, and how many layers of elements it keeps across; with recycle it gets them",
    )
    _add_surfaces(move, "in the unit of MESH")


def _add_check(commands: Any) -> None:
    check = commands.add_parser(
        "check",
        help="say what a mesh is, and what would go wrong with it",
        description="Say what a mesh is, and what would go wrong with it. The exit status is 0 if nothing would, 1 if "
        "faults were found, and 2 if the file holds no mesh at all. Hints are no faults.",
    )
    _add_mesh(check)
    _add_surfaces(check, "in metres")


def _add_surfaces(command: argparse.ArgumentParser, unit: str) -> None:
    command.add_argument(
        "--surfaces",
        metavar="TOML",
        type=surfaces_of,
        action="append",
        default=[],
        help="of tetrahedra, the surface that a boundary is on, " + unit + ': \'NAME = {surface = "cylinder", point = '
        "[0, 0, 0], axis = [0, 0, 1], radius = 0.05}', or a plane (point, normal), a sphere (centre, radius) or a cone "
        "(apex, axis, half_angle)",
    )


def _add_init(commands: Any) -> None:
    init = commands.add_parser(
        "init",
        help="write a commented case for a mesh, its names filled in",
        description="Write a case for `run`: the names of the mesh filled in, every option in a comment, all in SI "
        "units. A case that is there stays as it is.",
    )
    _add_mesh(init)
    _add_file(init, "CASE.toml", "the case to write, by default beside MESH")
    init.add_argument("--output", dest="out", type=Path, action=_OldSpelling, help=argparse.SUPPRESS)


def _add_mesh(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "mesh", metavar="MESH", type=Path, help="a mesh file of any kind that ka.read_mesh reads, or a folder of Elmer"
    )
    command.add_argument("--scale", metavar="S", type=float, default=1.0, help="metres per unit of MESH: 1e-3 for mm")


def _add_run(commands: Any) -> None:
    run = commands.add_parser(
        "run",
        help="adapt the mesh of a case and write what comes of it",
        description="Adapt the mesh of a case, and write adapted.msh (in the unit of the mesh), adapted.vtu (in "
        "metres, B and H as means of the elements), inside.vtu (the field inside them, above order 1), history.csv "
        "(a row for every pass), pictures and report.html. Ctrl-C ends it at once; the best pass so far is written "
        "then, and --resume goes on.",
    )
    run.add_argument("case", metavar="CASE.toml", type=Path, help="mesh, materials, boundaries and options")
    _add_folder_or_resume(run, "folder of a run that was cut short: go on from its last pass")
    run.add_argument("--force", action="store_true", help="write over the result of a run that is in the folder")
    run.add_argument("--dry-run", action="store_true", help="check the case and its mesh, solve and write nothing")
    run.add_argument("--quiet", action="store_true", help="say nothing but warnings and errors")


def _add_sweep(commands: Any) -> None:
    sweep = commands.add_parser(
        "sweep",
        help="adapt a case for many values of its keys, several at a time, and tabulate its outputs",
        description="Adapt a case for every combination of values of some of its keys, and write sweep.csv (a row for "
        "each, with the outputs of the case) and sweep.png (outputs over the first key, a curve for every other "
        "value). Ctrl-C ends it at once; what is finished is kept, and --resume goes on. The exit status is 1 if "
        "an error ended one of them.",
    )
    sweep.add_argument("case", metavar="CASE.toml", type=Path, help="mesh, materials, boundaries, outputs and options")
    sweep.add_argument(
        "--over",
        metavar="NAME=FIRST:LAST:COUNT",
        action="append",
        required=True,
        help="a key, as materials.coil.current_density, and so many evenly spaced values of it; may be repeated",
    )
    who = sweep.add_mutually_exclusive_group()
    who.add_argument("--jobs", metavar="N", type=int, help="processes, by default one for every core, or thread")
    who.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster that is to compute it")
    _add_folder_or_resume(sweep, "folder of a sweep that was cut short: compute what is not finished")
    sweep.add_argument("--quiet", action="store_true", help="say nothing but warnings and errors")


def least_quality(text: str) -> LeastQuality:
    try:
        return "auto" if text == "auto" else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number or auto; got {text!r}") from None


def surfaces_of(text: str) -> dict[str, Surface]:
    try:
        return table_of(surface)(tomllib.loads(text), "surfaces")
    except (ValueError, RecursionError) as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _add_folder_or_resume(command: Any, resume: str) -> None:
    where = command.add_mutually_exclusive_group()
    _add_folder(where)
    where.add_argument("--resume", metavar="DIR", type=Path, help=resume)


def _add_folder(command: Any, required: bool = False) -> None:
    _add_file(command, "DIR", "folder for the files; created if missing", required)


def _add_file(command: Any, what: str, said: str, required: bool = False) -> None:
    command.add_argument("-o", "--out", metavar=what, type=Path, required=required, help=said)


class _OldSpelling(argparse.Action):
    """Action for an option under its former name, which stores a warning."""

    def __call__(self, parser: Any, namespace: argparse.Namespace, values: Any, option_string: Any = None) -> None:
        setattr(namespace, self.dest, values)
        namespace.renamed = f"{option_string} is --{self.dest} now, and will not be understood for ever."


def writable_folder(folder: Path) -> Path:
    """Create the folder and check its write permission."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        raise OSError(f"--out expected a folder that takes files; '{folder}' does not: {error.strerror}.") from error


def refuse_link(folder: Path) -> None:
    if folder.is_symlink():
        raise FileExistsError(
            f"'{folder}' is a link, and files behind links are not replaced: remove the link, or choose another folder."
        )
