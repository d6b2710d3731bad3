"""Run `python -m benchmarks NAME ... [--seeds 5] [--quick] [--write]`; `--help` lists the names."""

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path

from benchmarks import written
from benchmarks.checks import (
    anisotropy,
    axis,
    corners,
    curves,
    effectivity,
    engineer,
    error,
    error_in_space,
    fingerprints,
    forces_in_space,
    goal_orders,
    map_ablation,
    papers,
    scale,
    speed,
)
from benchmarks.peers import case_oracle, hp, hp_in_space, peers, peers_in_space, time_to_error, wheels

CHECKS = {
    "time": time_to_error,
    "error": error,
    "error-in-space": error_in_space,
    "forces-in-space": forces_in_space,
    "speed": speed,
    "anisotropy": anisotropy,
    "scale": scale,
    "map": map_ablation,
    "axis": axis,
    "curves": curves,
    "papers": papers,
    "goal-orders": goal_orders,
    "corners": corners,
    "effectivity": effectivity,
    "engineer": engineer,
}


def peers_report(options: argparse.Namespace) -> Iterable[str]:
    """Yield the comparison with peers of a dimension and order."""
    if options.three_d:
        yield peers_in_space.report(options.order, options.seeds, options.quick)
    else:
        yield peers.report(options.seeds, options.quick)


def hp_report(options: argparse.Namespace) -> Iterable[str]:
    """Yield one table after another."""
    return hp_in_space.parts(options.quick) if options.three_d else hp.parts(options.quick)


def fingerprints_report(options: argparse.Namespace) -> Iterable[str]:
    """Yield hashes, or the comparison of numbers with those in a file."""
    if options.close:
        yield fingerprints.closeness(options.close, options.quick)
    else:
        yield fingerprints.report(options.seeds, options.quick)


WHEELS = ("gmsh", "mmgpy", "ngsolve")
REPORTS: dict[str, Callable[[argparse.Namespace], Iterable[str]]] = {
    "peers": peers_report,
    "hp": hp_report,
    "fingerprints": fingerprints_report,
} | {name: lambda options, check=check: [check.report(options.seeds, options.quick)] for name, check in CHECKS.items()}


def main() -> None:
    """Print the comparisons and checks that are asked for, or cases beside a reference solution."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("what", nargs="+", metavar="NAME", help=f"any of {' '.join(REPORTS)}, or oracle and cases")
    parser.add_argument("--seeds", type=int, default=5, help="medians over seeds 0 to SEEDS - 1 (default 5)")
    parser.add_argument("--quick", action="store_true", help="small meshes only")
    parser.add_argument("--write", action="store_true", help="fill the tables of README.md and of the pages, too")
    parser.add_argument("--three-d", action="store_true", help="peers, hp: on tetrahedra")
    parser.add_argument("--order", type=int, choices=(1, 2), default=1, help="peers --three-d: order of the elements")
    parser.add_argument("--fine", type=int, default=0, metavar="N", help="oracle CASE.toml: halve the elements N times")
    parser.add_argument("--values", type=Path, metavar="FILE", help="oracle CASE.toml: of another program, by output")
    parser.add_argument("--close", type=Path, metavar="FILE", help="fingerprints: numbers, written or compared")
    options = parser.parse_args()
    if options.seeds < 1:
        parser.error(f"--seeds must be at least 1, how many there are; got {options.seeds}")
    if options.fine < 0:
        parser.error(f"--fine must be at least 0, how often the elements are halved; got {options.fine}")
    if options.write and options.quick:
        parser.error("--write fills tables of whole runs; leave out --quick")
    files = [name for name in options.what if name.endswith(".toml")]
    names = [name for name in options.what if name not in files]
    if (files or "oracle" in names) and not (files and names == ["oracle"]):
        parser.error(
            f"the oracle alone takes cases: python -m benchmarks oracle CASE.toml; got {' '.join(options.what)}"
        )
    if unknown := [name for name in names if not files and name not in REPORTS]:
        parser.error(f"{unknown[0]} is not one of {' '.join(REPORTS)}")
    options.seeds = range(options.seeds)
    try:
        for file in files:
            print(case_oracle.report(Path(file), options.fine, options.values) + "\n", flush=True)
        for name in () if files else names:
            show(name, options)
    except (ImportError, OSError, ValueError) as failure:
        parser.exit(1, f"{names[0]}: {failure}\n")


def show(name: str, options: argparse.Namespace) -> None:
    """Print a report part by part, and fill the tables that are its."""
    if options.write and (missing := [line for wheel in WHEELS if (line := wheels.missing(wheel))]):
        raise ValueError(f"--write needs all wheels of the extra 'bench': {missing[0]}")
    parts = []
    for part in REPORTS[name](options):
        parts.append(part)
        print(part + "\n", flush=True)
    if options.write:
        called = f"{name} --three-d" if options.three_d else name
        called += f" --order {options.order}" if options.three_d and options.order > 1 else ""
        for page in written.fill(called, "\n\n".join(parts)):
            print(f"written: {page.relative_to(written.ROOT)}", flush=True)


if __name__ == "__main__":
    main()
