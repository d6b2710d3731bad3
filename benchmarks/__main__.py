"""Run `python -m benchmarks [NAME ...] [--seeds 5] [--quick]`; `--help` lists the names."""

import argparse
from pathlib import Path

from benchmarks.checks import (
    anisotropy,
    axis,
    ball,
    budget,
    coils,
    corners,
    curves,
    drift,
    effectivity,
    effectivity_in_space,
    engineer,
    error,
    error_in_space,
    files,
    fingerprints,
    force,
    forces_in_space,
    goal_orders,
    goals,
    growth,
    jobs,
    large,
    limit,
    location,
    magnets,
    magnification,
    map_ablation,
    nonlinear,
    orders,
    outlines,
    own_source,
    pairs,
    papers,
    passes,
    scale,
    slivers,
    space,
    space_bodies,
    space_map,
    space_order_2,
    space_passes,
    space_polish,
    space_polish_order2,
    space_threads,
    speed,
    spread,
    sweeps,
    warmup,
)
from benchmarks.checks import round as one_round
from benchmarks.peers import (
    case_oracle,
    hexahedra,
    hp,
    hp_in_space,
    ngsolve_oracle,
    peers_in_space,
    peers_order_2,
    peers_report,
    time_to_error,
)
from benchmarks.peers.report import comparison
from benchmarks.problems.cases import PROBLEMS, cases

CHECKS = {
    "peers": peers_report.report,
    "time": time_to_error.report,
    "error": error.report,
    "error-in-space": error_in_space.report,
    "forces-in-space": forces_in_space.report,
    "speed": speed.report,
    "warmup": warmup.report,
    "anisotropy": anisotropy.report,
    "drift": drift.report,
    "spread": spread.report,
    "scale": scale.report,
    "slivers": slivers.report,
    "map": map_ablation.report,
    "sweeps": sweeps.report,
    "space": space.report,
    "space-map": space_map.report,
    "space-passes": space_passes.report,
    "space-polish": space_polish.report,
    "space-polish-order-2": space_polish_order2.report,
    "space-bodies": space_bodies.report,
    "space-threads": space_threads.report,
    "limit": limit.report,
    "ball": ball.report,
    "round": one_round.report,
    "orders": orders.report,
    "axis": axis.report,
    "curves": curves.report,
    "passes": passes.report,
    "magnets": magnets.report,
    "magnification": magnification.report,
    "nonlinear": nonlinear.report,
    "outlines": outlines.report,
    "own-source": own_source.report,
    "location": location.report,
    "pairs": pairs.report,
    "papers": papers.report,
    "force": force.report,
    "goals": goals.report,
    "growth": growth.report,
    "goal-orders": goal_orders.report,
    "corners": corners.report,
    "effectivity": effectivity.report,
    "effectivity-in-space": effectivity_in_space.report,
    "jobs": jobs.report,
    "engineer": engineer.report,
    "oracle": ngsolve_oracle.report,
    "references": hexahedra.report,
    "large": large.report,
    "space-order-2": space_order_2.report,
    "files": files.report,
    "fingerprints": fingerprints.report,
}


def print_oracle(parser: argparse.ArgumentParser, options: argparse.Namespace, files: list[Path]) -> None:
    """Print a comparison of every case with a reference solution."""
    others = [name for name in options.what if not name.endswith(".toml")]
    if others != ["oracle"]:
        parser.error(
            f"cases are for the oracle: python -m benchmarks oracle CASE.toml; got {' '.join(others) or 'none'}"
        )
    if options.fine < 0:
        parser.error(f"--fine must be at least 0, how often the elements are halved; got {options.fine}")
    for file in files:
        try:
            print(case_oracle.report(file, options.fine, options.values) + "\n", flush=True)
        except (ImportError, OSError, ValueError) as error:
            parser.exit(2, f"oracle: {error}\n")


def main() -> None:
    """Print the comparisons and checks that are asked for, by default the comparisons of all problems."""
    names = [*PROBLEMS, *CHECKS, "hp", "budget", "coils"]
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("what", nargs="*", metavar="NAME", help=f"any of {' '.join(names)}")
    parser.add_argument("--seeds", type=int, default=5, help="medians over seeds 0 to SEEDS - 1 (default 5)")
    parser.add_argument("--quick", action="store_true", help="small meshes only")
    parser.add_argument("--three-d", action="store_true", help="peers, hp: on tetrahedra")
    parser.add_argument("--order", type=int, choices=(1, 2), default=1, help="peers --three-d: order of the elements")
    parser.add_argument("--loops", action="store_true", help="hp: NGSolve's adaptive loop, too (slow)")
    parser.add_argument("--polish", action="store_true", help="coils: the polish beside coils only")
    parser.add_argument("--team20", action="store_true", help="coils: the force of TEAM problem 20 only")
    parser.add_argument("--tight", action="store_true", help="coils: the same force to 0.3 %% only (6 minutes)")
    parser.add_argument("--finest", action="store_true", help="coils: the same force by order 2 only (3 minutes)")
    parser.add_argument("--linkage", action="store_true", help="coils: inductances only")
    parser.add_argument("--pot", action="store_true", help="coils: a pot magnet against its section only")
    parser.add_argument("--torus", action="store_true", help="coils: bounds of a closed torus only")
    parser.add_argument("--bracket", action="store_true", help="coils: bounds by both potentials, and fluxes, only")
    parser.add_argument("--million", action="store_true", help="coils: one solution on a million edges, only")
    parser.add_argument("--fine", type=int, default=0, metavar="N", help="oracle CASE.toml: halve the elements N times")
    parser.add_argument("--values", type=Path, metavar="FILE", help="oracle CASE.toml: of another program, by output")
    parser.add_argument("--suite", type=Path, metavar="FILE", help="budget: what pytest printed of the last run")
    parser.add_argument("--warmup", action="store_true", help="budget: compile every kernel to see how long it takes")
    parser.add_argument("--close", type=Path, metavar="FILE", help="fingerprints: numbers, written or compared")
    options = parser.parse_args()
    if options.seeds < 1:
        parser.error(f"--seeds must be at least 1, how many there are; got {options.seeds}")
    files = [Path(name) for name in options.what if name.endswith(".toml")]
    if files:
        print_oracle(parser, options, files)
        return
    for name in options.what or PROBLEMS:
        if name in PROBLEMS:
            for case in cases(name, options.quick):
                print(comparison(case, range(options.seeds)) + "\n", flush=True)
        elif name == "peers" and options.three_d:
            of_order = peers_order_2 if options.order == 2 else peers_in_space
            print(of_order.report(range(options.seeds), options.quick) + "\n", flush=True)
        elif name == "hp":
            for part in hp_in_space.parts(options.quick) if options.three_d else hp.parts(options.quick, options.loops):
                print(part + "\n", flush=True)
        elif name == "fingerprints" and options.close:
            try:
                print(fingerprints.closeness(options.close, options.quick) + "\n", flush=True)
            except ValueError as error:
                parser.exit(1, f"fingerprints: {error}\n")
        elif name in CHECKS:
            print(CHECKS[name](range(options.seeds), options.quick) + "\n", flush=True)
        elif name == "coils":
            parts = [part for part in coils.PARTS if getattr(options, part, False)]
            print(coils.report(options.quick, parts) + "\n", flush=True)
        elif name == "budget":
            print(budget.report(options.suite, options.warmup) + "\n", flush=True)
        else:
            parser.error(f"{name} is not one of {' '.join(names)}")


if __name__ == "__main__":
    main()
