"""Report of an adaptation as one HTML file."""

from collections import Counter
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.files import whole_file
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.loop.why_held import without_turns
from kohonen_adapt.mesh.slicing import CutBy
from kohonen_adapt.report.page import filled_page
from kohonen_adapt.report.scene import FieldOf, HeldBy, view_data
from kohonen_adapt.report.summary import key_figures, sentences, versions, without_folders

__all__ = ["write_report"]

Picture = bytes | str | PathLike[str]


def write_report(
    path: str | PathLike[str],
    result: AdaptResult,
    *,
    before: AdaptResult,
    title: str = "Adaptation of a mesh",
    asked: str = "",
    point_data: Mapping[str, FieldOf] | None = None,
    cell_data: Mapping[str, FieldOf] | None = None,
    indicator_label: str = "error indicator of an element",
    held: HeldBy | None = None,
    plane: CutBy | None = None,
    unit: str = "m",
    axisymmetric: bool = False,
    pictures: Mapping[str, Picture] | None = None,
    settings: Mapping[str, str] | None = None,
) -> None:
    """Write a report with a view of the meshes, the passes, pictures and settings.

    The file is written whole or not at all. It is self-contained, loads nothing from the network and shows all names as
    text. The view needs a browser of 2023 or later (with ``DecompressionStream``); the rest needs no JavaScript. The
    size is about 25 bytes per element of either mesh.

    Parameters
    ----------
    path
        The file, by custom ``report.html``.
    result
        Result of `kohonen_adapt.adapt`, for any problem.
    before
        The input: the result of ``adapt(..., passes=0)``.
    title, asked
        Heading, and a sentence on the task.
    point_data, cell_data
        Fields of the view: label, with a unit, to a function of a solution that returns values (nnodes,) or
        (nelements,); for a field that is linear in every element (3, nelements), at the corners of ``mesh.t``. The
        first of `cell_data` is shown at first; contours are those of the first of `point_data`. Indicators, quality,
        size and subdomains are always included.
    indicator_label
        Label of the indicators, with their unit.
    held
        Function of a result that returns why each node of its mesh is held, (nnodes,) texts as of
        `kohonen_adapt.why_held`, empty for other nodes. The report has a table of the reasons, and the view of a mesh
        of triangles marks the nodes.
    plane
        Cut through meshes of tetrahedra for the view, a `kohonen_adapt.Plane`.
    unit
        Unit of lengths: "m" or "mm" for a mesh in metres, "" for a mesh without a unit.
    axisymmetric
        True if x and y of the mesh are r and z around an axis.
    pictures
        Caption to a PNG or GIF file: its path, or its bytes. The first picture has a row of its own.
    settings
        Name to text for repeating the computation, such as ``{"Command": ...}``. Absolute paths in it are cut to file
        names.

    Raises
    ------
    ValueError
        If a field has the wrong shape, the unit is unknown, a picture is neither PNG nor GIF, or a mesh of tetrahedra
        has no plane that meets it.
    OSError
        If the file cannot be written or a picture cannot be read.

    Examples
    --------
    ::

        before, after = ka.adapt(mesh, problem, passes=0), ka.adapt(mesh, problem)
        write_report("report.html", after, before=before, point_data={"A (Wb/m)": lambda field: field.potential})
    """
    why = [without_turns(np.asarray(held(each))) for each in (before, result)] if held else []
    data = view_data(
        {"before": before, "after": result},
        point_data=point_data or {},
        cell_data=cell_data or {},
        indicator_label=indicator_label,
        why=why if plane is None else [],
        plane=plane,
        unit=unit,
        axisymmetric=axisymmetric,
    )
    content = filled_page(
        title=title,
        summary=[*([asked] if asked else []), *sentences(result)],
        figures=key_figures(result),
        result=result,
        held=counts_by_reason(why),
        pictures={caption: _content(picture) for caption, picture in (pictures or {}).items()},
        settings={name: without_folders(text) for name, text in (settings or {}).items()},
        versions=versions(),
        data=data,
    )
    with whole_file(Path(path)) as draft:
        draft.write_bytes(content)


def counts_by_reason(why: Sequence[NDArray[np.str_]]) -> list[tuple[str, ...]]:
    counts = [Counter(texts[texts != ""].tolist()) for texts in why]
    reasons = [reason for reason, _ in sum(counts, Counter()).most_common()]
    return [(reason, *(str(each[reason]) for each in counts)) for reason in reasons]


def _content(picture: Picture) -> bytes:
    return picture if isinstance(picture, bytes) else Path(picture).read_bytes()
