"""Report of an adaptation as one HTML file."""

import base64
import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from kohonen_adapt.arrays import FilePath
from kohonen_adapt.files import write_whole
from kohonen_adapt.geometry.held_nodes import without_turns
from kohonen_adapt.loop.result import AdaptResult, html_table
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.hypercircle import Bracket
from kohonen_adapt.mesh.slicing import CutBy
from kohonen_adapt.report.scene import FieldOf, HeldBy, view_data
from kohonen_adapt.report.summary import (
    bracket_sentences,
    ending_text,
    key_figures,
    versions,
    without_folders,
)
from kohonen_adapt.version import __version__

__all__ = ["filled_page", "write_report"]

Picture = bytes | FilePath
SCRIPTS = ("meshes.js", "layer.js", "legend.js", "view.js")
SIGNATURES = {b"\x89PNG\r\n\x1a\n": "png", b"GIF8": "gif"}


def write_report(
    path: FilePath,
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
    coils: Iterable[Coil] = (),
    unit: str = "m",
    axisymmetric: bool = False,
    pictures: Mapping[str, Picture] | None = None,
    settings: Mapping[str, str] | None = None,
    bracket: Bracket | None = None,
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
        (nelements,), or for fields of higher order (k, nelements): at the points of a `kohonen_adapt.display.lattice`
        in every element, of which three are the corners. Fields are linear between these points. The first of
        `cell_data` is shown at first; contours are those of the first of `point_data`. Indicators, quality,
        size and subdomains are always included.
    indicator_label
        Label of the indicators, with their unit.
    held
        Function of a result that returns why each node of its mesh is held, (nnodes,) texts as of
        `kohonen_adapt.why_held`, empty for other nodes. The report has a table of the reasons, and the view of a mesh
        of triangles marks the nodes.
    plane
        Cut through meshes of tetrahedra for the view, a `kohonen_adapt.Plane`.
    coils
        Coils whose sections the view shows in the cut.
    unit
        Unit of lengths: "m" or "mm" for a mesh in metres, "" for a mesh without a unit.
    axisymmetric
        True if x and y of the mesh are r and z around an axis.
    pictures
        Caption to a PNG or GIF file: its path, or its bytes. The first picture has a row of its own.
    settings
        Name to text for repeating the computation, such as ``{"Command": ...}``. Absolute paths in it are cut to file
        names.

    bracket
        Bounds of the energy of the result in space, a `kohonen_adapt.magnetostatics.Bracket`.

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
    counts = [Counter(texts[texts != ""].tolist()) for texts in why]
    reasons = [reason for reason, _ in sum(counts, Counter()).most_common()]
    data = view_data(
        {"before": before, "after": result},
        (point_data or {}, cell_data or {}),
        indicator_label=indicator_label,
        why=why if plane is None else [],
        plane=plane,
        coils=coils,
        unit=unit,
        axisymmetric=axisymmetric,
    )
    content = filled_page(
        title=title,
        summary=[*([asked] if asked else []), ending_text(result), *bracket_sentences(bracket)],
        figures=key_figures(result),
        result=result,
        held=[(reason, *(str(each[reason]) for each in counts)) for reason in reasons],
        pictures={caption: _content(picture) for caption, picture in (pictures or {}).items()},
        settings={name: without_folders(text) for name, text in (settings or {}).items()},
        data=data,
    )
    write_whole(Path(path), content)


def _content(picture: Picture) -> bytes:
    return picture if isinstance(picture, bytes) else Path(picture).read_bytes()


def filled_page(
    *,
    title: str,
    summary: Iterable[str],
    figures: Iterable[tuple[str, str]],
    result: AdaptResult,
    held: Sequence[tuple[str, ...]],
    pictures: Mapping[str, bytes],
    settings: Mapping[str, str],
    data: Mapping[str, Any],
) -> bytes:
    """Return the page of a report.

    Parameters
    ----------
    held
        Reason, and the number of nodes before and after.
    pictures
        Caption to the bytes of a PNG or GIF file.
    settings
        Texts of any length by name.
    data
        Data of the view, ready for JSON.

    Raises
    ------
    ValueError
        If a picture is neither PNG nor GIF.
    """
    style, script = _part("style.css"), "\n".join(_part(name) for name in SCRIPTS)
    allowed = f"style-src {_hash(style)}; script-src {_hash(script)}; img-src data:"
    sources = [(caption, _source(caption, content)) for caption, content in pictures.items()]
    filled = Template(_part("page.html")).substitute(
        policy=f"default-src 'none'; {allowed}; base-uri 'none'; form-action 'none'",
        title=escape(title),
        generator=escape(f"kohonen_adapt {__version__}"),
        style=style,
        summary=_each("<p>{}</p>", ((sentence,) for sentence in summary)),
        figures=_each("<div><dt>{}</dt><dd>{}</dd></div>", figures),
        passes=html_table(result.history, [' class="result"' * (step is result.best) for step in result.history]),
        held=_each('<tr><th scope="row">{}</th><td>{}</td><td>{}</td></tr>', held),
        without_held="" if held else " hidden",
        pictures=_each('<figure><img src="{1}" alt="{0}"><figcaption>{0}</figcaption></figure>', sources),
        without_pictures="" if pictures else " hidden",
        settings=_each("<h3>{}</h3>\n<pre>{}</pre>", settings.items()),
        versions=_each("<dt>{}</dt><dd>{}</dd>", versions().items()),
        data=json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
        script=script,
    )
    return filled.encode("utf-8", "replace")  # for unpaired surrogates in names


def _part(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def _each(form: str, rows: Iterable[tuple[str, ...]]) -> str:
    return "\n".join(form.format(*map(escape, row)) for row in rows)


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _source(caption: str, content: bytes) -> str:
    kind = next((kind for start, kind in SIGNATURES.items() if content.startswith(start)), None)
    if kind is None:
        raise ValueError(f"pictures must be PNG or GIF files; '{caption}' begins with {content[:8]!r}.")
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"
