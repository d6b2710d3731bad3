"""Settings of a run, and the fingerprint that distinguishes runs."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from kohonen_adapt.arrays import Ints
from kohonen_adapt.geometry.plane.curves import Curve
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.loop.growth import Growth, GrowthByTolerance, NodeCounts
from kohonen_adapt.problem.evaluation import Output
from kohonen_adapt.problem.orders import at_order_of_passes
from kohonen_adapt.problem.protocol import Problem, is_curved, norm_of, order_of
from kohonen_adapt.som.schedule import Schedule, check_training

__all__ = ["DIGEST", "ONLY_ENDS", "PASSES", "PASSES_TO_TOLERANCE", "ErrorsWanted", "Settings", "fingerprint"]

DIGEST = "sha256 "
PASSES, PASSES_TO_TOLERANCE = 4, 12

ONLY_ENDS = {"only ends": True}  # metadata of a setting that ends the loop, and changes no pass


@dataclass(frozen=True)
class ErrorsWanted:
    goal: bool = False
    outputs: bool = False


@dataclass(frozen=True)
class Settings:
    rules: Rules
    schedule: Schedule | None
    seed: int
    polish: bool
    growth: NodeCounts = field(metadata={"argument": "target_nodes"})
    outputs: Mapping[str, Output]
    rtol: float | None = field(default=None, metadata=ONLY_ENDS)
    estimated: ErrorsWanted = field(default=ErrorsWanted(), metadata=ONLY_ENDS)

    def __post_init__(self) -> None:
        check_training(self.schedule, self.seed)
        if not isinstance(self.polish, bool | np.bool_):
            raise ValueError(
                f"polish must be True or False; got {self.polish!r}. kohonen_adapt.polish polishes without a map."
            )

    def rng(self, number: int) -> np.random.Generator:
        return np.random.default_rng(int(np.random.SeedSequence((self.seed, number)).generate_state(1)[0]))


def fingerprint(mesh: Mesh, problem: Problem, settings: Settings) -> dict[str, str]:
    # The results of the problem and of the outputs are not included, nor the settings that only end the loop.
    sides = {None: "", True: " on curved elements", False: " on straight elements"}[is_curved(problem)]
    order = order_of(at_order_of_passes(problem))
    texts = {
        "mesh": digest(mesh.p, mesh.t, *_set_arrays(mesh.boundaries), *_set_arrays(mesh.subdomains)),
        "problem": f"{type(problem).__name__} of order {order} in the {norm_of(problem)} norm{sides}",
    }
    for group in (settings.rules, settings):
        for entry in fields(group):
            if entry.metadata != ONLY_ENDS and entry.name != "rules":
                name = entry.metadata.get("argument", entry.name)
                texts[name] = _text(getattr(group, entry.name), mesh)
    return texts


def _text(value: Any, mesh: Mesh) -> str:
    if value is None:
        return "none"
    if isinstance(value, GrowthByTolerance):  # the passes so far serve any tolerance
        return "none"
    if isinstance(value, Growth):
        return f"{value.target} in {value.passes} passes" if value.target > value.start else "none"
    if isinstance(value, Mapping) and any(hasattr(item, "project") for item in value.values()):
        return _curve_digest(mesh, value)
    if isinstance(value, Mapping) and all(callable(item) for item in value.values()):
        return str(sorted(value))
    if isinstance(value, Mapping):
        return str({name: _without_type(item) for name, item in sorted(value.items())})
    if isinstance(value, list | tuple | range | np.ndarray):
        return str([_without_type(item) for item in value])
    return str(_without_type(value))


def _without_type(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else tuple(value) if isinstance(value, list) else value


def _set_arrays(sets: Mapping[str, Ints] | None) -> list[NDArray[Any]]:
    arrays: list[NDArray[Any]] = [np.array(sets is None)]
    for name, rows in (sets or {}).items():
        arrays += [
            np.array(name),
            np.asarray(rows, dtype=np.int64),
            np.asarray(getattr(rows, "ori", []), dtype=np.int64),
        ]
    return arrays


def _curve_digest(mesh: Mesh, curves: Mapping[str, Curve]) -> str:
    arrays: list[NDArray[Any]] = []
    for name, curve in sorted(curves.items()):
        ends = mesh.p[:, mesh.facets[:, np.asarray((mesh.boundaries or {})[name])]]
        arrays += [np.array(name), np.asarray(curve.project(ends.mean(axis=1)), dtype=float)]
    return digest(*arrays)


def digest(*arrays: NDArray[Any]) -> str:
    hashed = sha256()
    for array in map(np.ascontiguousarray, arrays):
        hashed.update(f"{array.dtype.str}{array.shape}".encode())
        hashed.update(array.tobytes())
    return f"{DIGEST}{hashed.hexdigest()[:32]}"
