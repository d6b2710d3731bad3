"""Arguments of the command ``kohonen-adapt``."""

import argparse
import tempfile
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from kohonen_adapt.cases.readers import table_of
from kohonen_adapt.cases.tables import surface
from kohonen_adapt.geometry.rules import TOPOLOGIES, LeastQuality, Rules
from kohonen_adapt.geometry.space.surfaces import Surface

__all__ = ["check_resumed", "command_parser", "options_of", "options_text", "writable_folder"]

TOLERANCES = {
    "rtol": "the estimated error, as a fraction of the energy norm",
    "output_rtol": "the estimated error of every output, as a fraction of its value",
    "goal_rtol": "the estimated error of the goal, as a fraction of its value",
}
"""Options of `run` and `sweep` that replace keys of ``adapt`` in the case, with what a tolerance limits."""

EPILOG = "Help on a command: kohonen-adapt COMMAND --help. To begin: kohonen-adapt init MESH."
MESHES = "mesh file (.msh, .msh2, .vtu, .vtk, .inp, .mesh, .su2, .med, .xdmf, .vol, .ans) or folder of Elmer"

Handler = Callable[..., int]


def command_parser(description: str | None, version: str, run: Mapping[str, Handler]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="kohonen-adapt", description=description, epilog=EPILOG)
    parser.add_argument("--version", action="version", version=f"kohonen-adapt {version}")
    commands = parser.add_subparsers(metavar="COMMAND", dest="command")
    demo = commands.add_parser(
        "demo",
        help="adapt an example and write its files",
        description="Adapt an included example, and write its mesh, fields, picture and report.",
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
        help="move the nodes of a mesh by an error, density or size field of any solver",
        description="Move the nodes of a mesh by a field of error indicators, densities or sizes. Physical groups keep "
        "their names and numbers, and points in a group their positions. The field has one number, or a tensor, per "
        "element or node of MESH. Its file is a VTU, VTK, XDMF or MED file, a .msh with NodeData, ElementData or "
        "ElementNodeData, a .pos of GetDP (Print[..., OnElementsOf ...]), or a .sol of Mmg. The name of the only field "
        "of a file may be left out.",
    )
    _add_mesh(move, "metres per unit of MESH, if FIELD is in metres (default: both have the same unit)")
    field = move.add_mutually_exclusive_group(required=True)
    field.add_argument("--density", metavar="FIELD.vtu:name", help="desired nodes per area or volume, up to a factor")
    field.add_argument(
        "--indicators", metavar="FIELD.vtu:name", help="error indicator of each element in the energy norm, not squared"
    )
    field.add_argument("--sizes", metavar="FIELD.vtu:name", help="desired edge lengths, or a metric, up to a factor")
    _add_file(move, "MESH2", "file (.msh, .msh2, .vtu) or folder of Elmer to write, in the unit of MESH", required=True)
    _add_limits(move)
    move.add_argument("--seed", metavar="N", type=int, default=0, help="seed of the random numbers (default: 0)")
    _add_quiet(move)


def _add_limits(move: argparse.ArgumentParser) -> None:
    move.add_argument(
        "--topology",
        choices=TOPOLOGIES,
        default=Rules.topology,
        help="fixed: nodes move; flip (default): edges are flipped, too; recycle: nodes are also removed and inserted "
        "elsewhere",
    )
    move.add_argument(
        "--min-quality",
        metavar="Q",
        type=least_quality,
        default=Rules.min_quality,
        help="minimum quality of an element, from 0 (flat) to 1 (equilateral); auto (default): 0.3, of tetrahedra 0.2",
    )
    move.add_argument(
        "--pinned", metavar="NAME", nargs="+", default=[], help="names and node numbers of nodes that do not move"
    )
    move.add_argument(
        "--periodic",
        metavar="NAME",
        nargs=2,
        action="append",
        default=[],
        help="two boundaries whose nodes stay matched",
    )
    move.add_argument(
        "--layers",
        metavar=("NAME", "K"),
        nargs=2,
        action="append",
        default=[],
        help="a thin subdomain, and the layers of elements to keep across it; recycle inserts missing layers",
    )
    _add_surfaces(move, "in the unit of MESH")


def _add_check(commands: Any) -> None:
    check = commands.add_parser(
        "check",
        help="describe a mesh and report its faults, or check a case",
        description="Describe a mesh and report its faults, or check a case (.toml) and print the plan of its run. The "
        "exit status is 0 without faults, 1 with faults, and 2 if the file cannot be read. Hints are not faults.",
    )
    _add_mesh(check)
    check.add_argument("--nodes", action="store_true", help="count the nodes that are held, by reason")
    _add_surfaces(check, "in metres")


def _add_surfaces(command: argparse.ArgumentParser, unit: str) -> None:
    command.add_argument(
        "--surfaces",
        metavar="TOML",
        type=surfaces_of,
        action="append",
        default=[],
        help="surface that contains the boundary NAME of a mesh of tetrahedra, " + unit + ": 'NAME = {surface = "
        '"cylinder", point = [0, 0, 0], axis = [0, 0, 1], radius = 0.05}\', or a plane (point, normal), a sphere '
        "(centre, radius) or a cone (apex, axis, half_angle in radians)",
    )


def _add_init(commands: Any) -> None:
    init = commands.add_parser(
        "init",
        help="write a commented case for a mesh",
        description="Write a case for `run`, with the names of the mesh filled in and every option in a comment. All "
        "units are SI. An existing case is not overwritten.",
    )
    _add_mesh(init)
    _add_file(init, "CASE.toml", "case to write (default: MESH with the suffix .toml)")
    init.add_argument("--output", dest="out", type=Path, action=_OldSpelling, help=argparse.SUPPRESS)


def _add_mesh(command: argparse.ArgumentParser, scale: str = "metres per unit of MESH: 1e-3 for mm") -> None:
    command.add_argument("mesh", metavar="MESH", type=Path, help=MESHES)
    command.add_argument("--scale", metavar="S", type=float, default=1.0, help=scale)


def _add_run(commands: Any) -> None:
    run = commands.add_parser(
        "run",
        help="adapt the mesh of a case and write the results",
        description="Adapt the mesh of a case, and write adapted.msh (in the unit of the mesh), adapted.vtu (in "
        "metres, B and H as means over elements), inside.vtu (the field within elements, above order 1), history.csv "
        "(one row per pass), pictures and report.html. Ctrl-C stops the run at once; the best finished pass is "
        "already written, and --resume continues.",
    )
    _add_case(run, "folder of an interrupted run, to continue after its last finished pass")
    run.add_argument("--force", action="store_true", help="overwrite the result of a run in the folder")
    run.add_argument("--dry-run", action="store_true", help="check the case and its mesh without solving or writing")


def _add_sweep(commands: Any) -> None:
    sweep = commands.add_parser(
        "sweep",
        help="adapt a case for many values of its keys, in parallel, and tabulate its outputs",
        description="Adapt a case for every combination of values of some of its keys, and write sweep.csv "
        "and sweep.json (one row per combination, with the outputs of the case, their estimated and allowed errors, "
        "and what missed its tolerance) and sweep.png (outputs over the first key, one curve per combination of the "
        "others, with error bars). Ctrl-C stops the sweep at once; finished combinations are kept, and --resume "
        "continues. The exit status is 1 if a combination failed.",
    )
    _add_case(sweep, "folder of an interrupted sweep, to compute the rest")
    sweep.add_argument(
        "--over",
        metavar="NAME=FIRST:LAST:COUNT",
        action="append",
        required=True,
        help="key of the case, such as materials.coil.current_density, and COUNT evenly spaced values; may be repeated",
    )
    who = sweep.add_mutually_exclusive_group()
    who.add_argument("--jobs", metavar="N", type=int, help="number of processes (default: one per core)")
    who.add_argument("--scheduler", metavar="ADDRESS", help="address of a Dask cluster for the computation")


def _add_quiet(command: argparse.ArgumentParser) -> None:
    command.add_argument("--quiet", action="store_true", help="print warnings and errors only")


def _add_case(command: argparse.ArgumentParser, resume: str) -> None:
    command.add_argument(
        "case", metavar="CASE.toml", type=Path, help="mesh, materials, boundaries, outputs and options"
    )
    for key, limited in TOLERANCES.items():
        text = f"adapt until {limited}, is at most T; replaces {key} of the case"
        command.add_argument(_option(key), metavar="T", type=tolerance, help=text)
    text = "largest number of nodes that a tolerance leads to; replaces max_nodes of the case"
    command.add_argument("--max-nodes", metavar="N", type=int, help=text)
    where = command.add_mutually_exclusive_group()
    _add_folder(where)
    where.add_argument("--resume", metavar="DIR", type=Path, help=resume)
    _add_quiet(command)


def _option(key: str) -> str:
    return f"--{key.replace('_', '-')}"


def options_of(arguments: argparse.Namespace) -> dict[str, Any]:
    given = {key: getattr(arguments, key) for key in (*TOLERANCES, "max_nodes")}
    return {key: value for key, value in given.items() if value is not None}


def options_text(options: Mapping[str, Any]) -> list[str]:
    return [f"{_option(key)}={value}" for key, value in options.items()]


def tolerance(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= 1.0:
        raise argparse.ArgumentTypeError(f"expected a fraction from 0 to 1, such as 1e-3 for 0.1 %; got {text!r}")
    return value


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


def _add_folder(command: Any, required: bool = False) -> None:
    _add_file(command, "DIR", "folder for the results, created if missing", required)


def _add_file(command: Any, what: str, text: str, required: bool = False) -> None:
    command.add_argument("-o", "--out", metavar=what, type=Path, required=required, help=text)


class _OldSpelling(argparse.Action):
    def __call__(self, parser: Any, namespace: argparse.Namespace, values: Any, option_string: Any = None) -> None:
        setattr(namespace, self.dest, values)
        namespace.renamed = f"{option_string} is deprecated; use --{self.dest}."


def writable_folder(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        raise OSError(f"--out expected a writable folder; cannot write to '{folder}': {error.strerror}.") from error


def check_resumed(folder: Path, resume: bool, what: str) -> None:
    """Refuse a link, and the absence of the folder of an earlier run to resume."""
    if resume and not folder.is_dir():
        raise FileNotFoundError(
            f"--resume expected the folder of an earlier {what}; '{folder.parent}' has no folder '{folder.name}'. "
            f"Start with --out {folder.parent}."
        )
    if folder.is_symlink():
        raise FileExistsError(
            f"'{folder}' is a link, and files behind links are not replaced. Remove the link, or choose another folder."
        )
