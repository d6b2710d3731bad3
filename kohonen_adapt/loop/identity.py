"""What makes a run the run it is, as texts: two runs that agree in them have the same passes."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.arrays import Ints
from kohonen_adapt.loop.checkpoint import digest
from kohonen_adapt.loop.growth import Growth
from kohonen_adapt.loop.step import Settings
from kohonen_adapt.outline.curves import Curve
from kohonen_adapt.problem.protocol import Problem, norm_of, order_of

__all__ = ["fingerprint"]


def fingerprint(
    mesh: MeshTri, problem: Problem, settings: Settings, growth: Growth, outputs: Iterable[str]
) -> dict[str, str]:
    """Name to text of everything that passes depend on, but for what the problem and its outputs work out.

    What only says when to end is not in it.
    """
    limits, pinned = settings.limits, settings.limits.pinned
    return {
        "mesh": _of_mesh(mesh),
        "problem": f"{type(problem).__name__} of order {order_of(problem)} in the {norm_of(problem)} norm",
        "schedule": repr(settings.schedule),
        "topology": limits.topology,
        "min_quality": repr(float(limits.min_quality)),
        "pinned": repr([pinned] if isinstance(pinned, str) else [_plain(pin) for pin in pinned]),
        "curves": _of_curves(mesh, limits.curves or {}),
        "periodic": repr([tuple(pair) for pair in limits.periodic]),
        "layers": repr({name: int(count) for name, count in (limits.layers or {}).items()}),
        "seed": str(settings.seed),
        "polish": str(bool(settings.polish)),
        "target_nodes": f"{growth.target} in {growth.steps} passes" if growth.target > growth.start else "none",
        "outputs": repr(sorted(outputs)),
    }


def _plain(pin: Any) -> int | str:
    return pin if isinstance(pin, str) else int(pin)


def _of_mesh(mesh: MeshTri) -> str:
    return digest(mesh.p, mesh.t, *_of_sets(mesh.boundaries), *_of_sets(mesh.subdomains))


def _of_sets(sets: Mapping[str, Ints] | None) -> list[NDArray[Any]]:
    """Names and members in order, and which side of it an oriented facet looks to."""
    found: list[NDArray[Any]] = [np.array(sets is None)]
    for name, rows in (sets or {}).items():
        found += [
            np.array(name),
            np.asarray(rows, dtype=np.int64),
            np.asarray(getattr(rows, "ori", []), dtype=np.int64),
        ]
    return found


def _of_curves(mesh: MeshTri, curves: Mapping[str, Curve]) -> str:
    """A curve is what it makes of the middles of its facets, which lie off it."""
    if not curves:
        return "none"
    found: list[NDArray[Any]] = []
    for name, curve in sorted(curves.items()):
        ends = mesh.p[:, mesh.facets[:, np.asarray((mesh.boundaries or {})[name])]]
        found += [np.array(name), np.asarray(curve.project(ends.mean(axis=1)), dtype=float)]
    return digest(*found)
