"""The command ``kohonen-adapt``: a demonstration from the installed package, progress and errors in plain lines."""

import argparse
import logging
import runpy
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from . import __version__
from .result import AdaptResult, Pass, Status

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
        0 if all went well, 1 if the problem could not be solved, 2 for wrong arguments and files that cannot be read
        or written, 130 for Ctrl-C.

    Raises
    ------
    SystemExit
        Where argparse ends the process: 0 after ``--help`` and ``--version``, 2 for arguments it does not know.
    """
    arguments = _parser().parse_args(argv)
    logging.basicConfig(format="%(message)s", level=logging.WARNING)
    logging.getLogger(__package__).setLevel(logging.INFO)
    try:
        return arguments.run(arguments)
    except (OSError, ValueError) as error:
        print(f"kohonen-adapt: {error}", file=sys.stderr)
        return WRONG_USE
    except KeyboardInterrupt:
        print("kohonen-adapt: interrupted.", file=sys.stderr)
        return INTERRUPTED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="kohonen-adapt", description=sys.modules[__package__].__doc__)
    parser.add_argument("--version", action="version", version=f"kohonen-adapt {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    demo = commands.add_parser("demo", help="adapt an example and write its files")
    demo.add_argument("name", choices=["magnet"], help="magnet: a permanent magnet in an iron core with an air gap")
    demo.add_argument("--out", metavar="DIR", type=Path, required=True, help="folder for the files; created if missing")
    demo.set_defaults(run=_demo)
    return parser


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
        if (error.name or "").partition(".")[0] != "matplotlib":
            raise
        print(PLOT_REMEDY)


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
