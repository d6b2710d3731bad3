"""Animations of the meshes of an adaptation, and of a map in training."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from math import ceil
from pathlib import Path

import numpy as np
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.random import Generator
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import FilePath
from kohonen_adapt.files import whole_file
from kohonen_adapt.loop.figures import error_text
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.mesh.slicing import CutBy
from kohonen_adapt.plotting.drawing import draw_mesh
from kohonen_adapt.som.kohonen_map import KohonenMap
from kohonen_adapt.som.schedule import Schedule, check_training

__all__ = ["animate_map", "animate_passes"]

Draw = Callable[[int, Generator], tuple[ArrayLike, ArrayLike | None]]
Frame = tuple[MeshTri, str]

MOST = 60  # maximum number of frames, which include the first and the last
HOLD = 1.6  # seconds added to the duration of the last frame, at least
DOTS = 110  # per inch
INCHES, MARGIN = 5.0, 0.6  # longer side of the mesh, and the space for the axes


def animate_passes(
    path: FilePath,
    history: Sequence[Pass],
    *,
    plane: CutBy | None = None,
    unit: str = "m",
    seconds: float = 0.8,
    axisymmetric: bool = False,
) -> None:
    """Write a GIF with one frame for the mesh of every pass.

    Parameters
    ----------
    path
        The file, usually ``*.gif``. An interrupted call leaves no partial file.
    history
        The passes, for instance ``result.history``. At most 60 evenly spaced passes are shown.
    plane
        Cutting plane for meshes of tetrahedra, a `kohonen_adapt.Plane`.
    unit
        Unit of the axes, "m", "mm" or "".
    seconds
        Duration of each frame.
    axisymmetric
        As in `draw_mesh`.

    Raises
    ------
    ValueError
        If `history` is empty, if the unit is unknown, or if `seconds` is not positive.
    OSError
        If the file cannot be written.
    """
    frames = [(step.mesh, f"pass {step.number}: {step.mesh.nvertices} nodes, {error_text(step)}") for step in history]
    _write(Path(path), frames, partial(draw_mesh, plane=plane, unit=unit, axisymmetric=axisymmetric), seconds)


def animate_map(
    path: FilePath,
    som: KohonenMap,
    points: ArrayLike | Draw,
    schedule: Schedule,
    *,
    weights: ArrayLike | None = None,
    seed: int = 0,
    unit: str = "",
    seconds: float = 0.25,
) -> tuple[float, ...]:
    """Train a map epoch by epoch and write a GIF of its mesh after each epoch.

    Parameters
    ----------
    path, unit, seconds
        As in `animate_passes`.
    som
        The map to train, which is changed.
    points, weights
        As in `KohonenMap.train`.
    schedule
        Stages without smoothing sweeps. Every epoch is trained by a call of its own, with its own order of the points.
        The final mesh is therefore near the mesh of ``som.train``, but not identical.
    seed
        Seed of the first epoch; each following epoch has the next integer.

    Returns
    -------
    tuple of float
        Quantisation error of every epoch, as in `KohonenMap.train`.

    Raises
    ------
    ValueError
        If an argument is invalid for training, if the unit is unknown, or if `seconds` is not positive.
    OSError
        If the file cannot be written.
    """
    check_training(schedule, seed)
    frames: list[Frame] = [(som.mesh, "before")]
    errors: list[float] = []
    if callable(points) and not schedule.fresh:
        most = max((stage.points_per_neuron for stage in schedule.stages), default=0.0)
        points, weights = points(ceil(most * frames[0][0].nvertices), np.random.default_rng(seed))
    for number, (title, epoch) in enumerate(_epochs(schedule)):
        errors += som.train(points, epoch, weights=weights, seed=seed + number)
        frames.append((som.mesh, f"epoch {number + 1}: {title}"))
        if schedule.tolerance is not None and errors[-1] < schedule.tolerance:
            break
    _write(Path(path), frames, partial(draw_mesh, unit=unit), seconds)
    return tuple(errors)


def _epochs(schedule: Schedule) -> Iterator[tuple[str, Schedule]]:
    for stage in schedule.stages:
        for rate in stage.rates().tolist():
            one = replace(stage, epochs=1, learning_rate=rate)
            yield f"radius {stage.radius}, rate {rate:.2g}", replace(schedule, stages=(one,))


def _write(path: Path, frames: Sequence[Frame], draw: Callable[[Axes, MeshTri], None], seconds: float) -> None:
    if not frames:
        raise ValueError("an animation needs a mesh at least; got none.")
    if not seconds > 0.0:
        raise ValueError(f"seconds must be above zero; got {seconds!r}.")
    figure, film = Figure(dpi=DOTS, layout="constrained"), PillowWriter(1.0 / seconds)  # type: ignore[arg-type]
    axes = figure.subplots()
    draw(axes, frames[0][0])
    size = np.ptp([axes.get_xlim(), axes.get_ylim()], axis=1)
    figure.set_size_inches(INCHES * np.clip(size / size.max(), 0.4, 1.0) + MARGIN)
    with whole_file(path) as draft:
        film.setup(figure, draft.with_suffix(".gif"))  # the format that Pillow writes
        for k in np.linspace(0, len(frames) - 1, min(MOST, len(frames))).round().astype(int).tolist():
            mesh, title = frames[k]
            axes.clear()
            draw(axes, mesh)
            axes.set_title(title, fontsize="medium")
            film.grab_frame()
        for _ in range(ceil(HOLD / seconds)):
            film.grab_frame()
        film.finish()
        draft.with_suffix(".gif").replace(draft)
