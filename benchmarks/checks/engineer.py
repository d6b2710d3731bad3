"""Rerun published models as an engineer would: what their meshes give before and after adapting."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems.elastic_l import ElasticL
from benchmarks.problems.getdp_magnet import GetdpMagnet
from benchmarks.problems.magnet_torque import MagnetTorque
from benchmarks.problems.slotless_motor import SlotlessMotor
from benchmarks.problems.stokes_cavity import StokesCavity
from benchmarks.problems.thick_coil import ThickCoil
from benchmarks.problems.undulator import Undulator
from benchmarks.table import Cell, markdown
from kohonen_adapt.magnetostatics import Goal

Values = Mapping[str, np.ndarray]  # of every quantity, one or more


class Model(Protocol):
    """A problem with published values, at one setting or several (angles)."""

    title: str
    settings: Sequence[Any]
    goal: Goal | None  # what to adapt for besides the energy

    def start(self, setting: Any) -> MeshTri:
        """The mesh to begin with."""

    def problem(self, setting: Any) -> ka.Problem:
        """What is to be solved."""

    def published(self, setting: Any) -> Values:
        """What should be found."""

    def measured(self, mesh: MeshTri, setting: Any) -> Values:
        """What is found on a mesh."""


MODELS: tuple[Model, ...] = (
    Undulator(1),
    Undulator(2),
    SlotlessMotor(1),
    SlotlessMotor(2),
    MagnetTorque(),
    ThickCoil(1),
    ThickCoil(2),
    GetdpMagnet(),
    ElasticL(),
    StokesCavity(),
)
NUMBERS = ("nodes", "published", "as meshed", "adapted", "by goal=", "error %", "adapted", "by goal=")


def report(seeds: Sequence[int], quick: bool) -> str:
    """Every quantity of every model; quick: of the first setting of each."""
    rows = [row for model in MODELS for row in rows_of(model, seeds, model.settings[: 1 if quick else None])]
    return markdown(["published model", "", *NUMBERS], rows)


def rows_of(model: Model, seeds: Sequence[int], settings: Sequence[Any]) -> list[list[Cell]]:
    """One row of the table for every quantity."""
    published = _joined([model.published(setting) for setting in settings])
    found = [values_of(model, seed, settings) for seed in seeds]
    nodes = max(model.start(setting).p.shape[1] for setting in settings)
    rows: list[list[Cell]] = []
    for name, exact in published.items():
        at = np.argmax(np.abs(exact))
        values: list[Cell] = [f"{column[name][at]:#.5g}" for column in (published, *found[0])]
        errors: list[Cell] = [
            100 * float(np.median([error(values[name], exact) for values in column]))
            for column in zip(*found, strict=True)
        ]
        missing: list[Cell] = [None] * (3 - len(errors))
        rows.append([model.title, name, nodes, *values, *missing, *errors, *missing])
    return rows


def values_of(model: Model, seed: int, settings: Sequence[Any]) -> list[Values]:
    """Of the meshes as they come, of the adapted ones, and where there is a goal of those adapted for it."""
    columns: list[list[Values]] = [[], [], []]
    for setting in settings:
        mesh, problem = model.start(setting), model.problem(setting)
        problems = [problem] if model.goal is None else [problem, dataclasses.replace(problem, goal=model.goal)]
        adapted = [ka.adapt(mesh, asked, seed=seed).mesh for asked in problems]
        for column, each in zip(columns, (mesh, *adapted), strict=False):
            column.append(model.measured(each, setting))
    return [_joined(column) for column in columns if column]


def error(values: np.ndarray, exact: np.ndarray) -> float:
    """Largest difference, as a fraction of the largest exact value."""
    return float(np.max(np.abs(values - exact)) / np.max(np.abs(exact)))


def _joined(parts: Sequence[Values]) -> dict[str, np.ndarray]:
    """The values of all settings, by quantity."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
