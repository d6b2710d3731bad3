"""Meshes, fields and colour scales for the view of a report."""

import base64
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, Texts
from kohonen_adapt.display import (
    decades_of,
    field_values,
    in_unit,
    level_of_share,
    outlined_facets,
    straight_and_curved,
)
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.coils.placement import listed_coils
from kohonen_adapt.mesh.measures import area, quality
from kohonen_adapt.mesh.names import labelled, named_sets
from kohonen_adapt.mesh.slicing import CutBy, Flat, cut_triangles, flat

__all__ = ["FieldOf", "HeldBy", "packed", "view_data"]

FieldOf = Callable[[Any], ArrayLike]
"""Function of a solution that returns the values of a field."""

HeldBy = Callable[[AdaptResult], ArrayLike]
"""Function of a result that returns the reason that holds each node."""

Results = Sequence[tuple[AdaptResult, Flat]]
"""Results with the plane meshes to show."""

NAMELESS = "no name"


MOST_NAMES = 255  # largest value of a byte; further sets of names share the last index


Shown = tuple[dict[str, Any], list[dict[str, str]]]
"""Label, kind and scale of a field, with packed values on every mesh."""


def view_data(
    results: Mapping[str, AdaptResult],
    fields: tuple[Mapping[str, FieldOf], Mapping[str, FieldOf]],
    *,
    indicator_label: str,
    why: Sequence[Texts],
    plane: CutBy | None,
    coils: Iterable[Coil],
    unit: str,
    axisymmetric: bool,
) -> dict[str, Any]:
    """Return the data of the view, ready for JSON.

    The keys of `results` are the labels on both sides of the divider, `fields` are by nodes and by elements. Meshes of
    tetrahedra are cut by `plane`. `why` is the reason that holds each node, for every mesh, or empty. Sections of
    `coils` in the plane are drawn as outlines.

    Raises
    ------
    ValueError
        If a function returns an array of the wrong shape, the unit is unknown, or the plane does not fit a mesh.
    """
    each = [(result, flat(result.mesh, plane, axisymmetric)) for result in results.values()]
    surfaces = [coil.winding.surface for coil in listed_coils(coils)]
    sections = [np.zeros((2, 2, 0)) if plane is None else cut_triangles(surface, plane) for surface in surfaces]
    shown = [
        *(_field(label, each, function, "element") for label, function in fields[1].items()),
        *(_field(label, each, function, "node") for label, function in fields[0].items()),
        _indicators(indicator_label, each),
        *_shapes(each, unit),
        _subdomains(each),
    ]
    reasons = [text for text, _ in Counter(text for texts in why for text in texts.tolist() if text).most_common()]
    index = {text: min(k, MOST_NAMES) for k, text in enumerate(reasons)}
    corners = np.hstack([own.mesh.p for _, own in each])
    return {
        "unit": unit,
        "reasons": reasons[: MOST_NAMES + 1],
        "axes": each[0][1].axes,
        "bounds": [(in_unit(unit) * bound).tolist() for bound in (corners.min(axis=1), corners.max(axis=1))],
        "fields": [about for about, _ in shown],
        "meshes": [
            {"name": word, **_mesh(each[k][1], sections, unit), "values": [values[k] for _, values in shown]}
            | ({"held": _held(why[k], index)} if why else {})
            for k, word in enumerate(results)
        ],
    }


def _mesh(shown: Flat, sections: Sequence[Floats], unit: str) -> dict[str, Any]:
    # float32 is most accurate there. Points on curved sides are added for drawing. The sides of elements are listed
    # for a cut only.
    mesh = shown.mesh
    cut = {}
    if shown.element is not None:
        cut = {"edges": packed(mesh.facets[:, shown.sides].T, "u4"), "elements": packed(shown.element, "u4")}
    centre = 0.5 * (mesh.p.min(axis=1) + mesh.p.max(axis=1))
    straight, curved = straight_and_curved(mesh, outlined_facets(mesh))
    along = np.stack([curved[:, :-1], curved[:, 1:]], axis=1).reshape(2, 2, -1)
    segments = np.concatenate([along, *sections], axis=2)
    points = np.hstack([mesh.p[:, : mesh.nvertices], segments.reshape(2, -1)])
    ends = mesh.nvertices + np.arange(segments[0].size).reshape(2, -1)
    lines = np.hstack([mesh.facets[:, straight], ends]).T
    x, y = in_unit(unit) * (points - centre[:, None])
    return {
        "centre": (in_unit(unit) * centre).tolist(),
        "x": packed(x, "f4"),
        "y": packed(y, "f4"),
        "t": packed(mesh.t, "u4"),
        "outline": packed(lines, "u4"),
        **cut,
    }


def _held(why: Texts, index: Mapping[str, int]) -> dict[str, Any]:
    node = np.flatnonzero(why != "")
    return {"node": packed(node, "u4"), "reason": packed([index[text] for text in why[node].tolist()], "u1")}


def _field(label: str, results: Results, function: FieldOf, at: str) -> Shown:
    # of nodes or elements, or in the plane on a lattice in each element
    nodal, meshes = at == "node", [shown.mesh for _, shown in results]
    on_shown = Flat.of_nodes if nodal else Flat.of_elements
    values = [
        on_shown(shown, field_values(label, function(each.solution), each.mesh, nodal)) for each, shown in results
    ]
    if nodal:
        finite = np.concatenate([each[np.isfinite(each)] for each in values])
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    else:
        lows, highs = zip(*map(_middle_ends, values, meshes), strict=True)
        low, high = min(0.0, *lows), max(highs)
    if any(each.ndim == 2 for each in values):
        at = "lattice"
        values = [
            each if each.ndim == 2 else each[mesh.t] if nodal else np.tile(each, (3, 1))
            for each, mesh in zip(values, meshes, strict=True)
        ]
    about, arrays = _scaled(label, values, low, high, at=at)
    return about | ({"lines": True} if nodal else {}), arrays


def _indicators(label: str, results: Results) -> Shown:
    values = [shown.of_elements(each.indicators) for each, shown in results]
    low, high = decades_of(values)
    return _scaled(label, values, low, high, "log") if high else _scaled(label, values, 0.0, 1.0)


def _scaled(
    label: str, values: Sequence[Floats], low: float, high: float, scale: str = "linear", at: str = "element"
) -> Shown:
    about = {"label": label, "kind": "values", "at": at, "scale": scale, "low": low, "high": high}
    about["below"] = any(np.any(each < low) for each in values)
    about["above"] = any(np.any(each > high) for each in values)
    return about, [packed(each, "f4", coarse=at != "node") for each in values]


def _middle_ends(values: Floats, mesh: Mesh) -> tuple[float, float]:
    finite = np.isfinite(values)
    if not finite.any():
        return 0.0, 1.0
    values, areas = values[finite], np.broadcast_to(area(mesh), values.shape)[finite]
    return level_of_share(values, areas, 0.01), level_of_share(values, areas, 0.99)


def _shapes(results: Results, unit: str) -> list[Shown]:
    dim = len(results[0][0].mesh.p)
    root, measure = {2: ("root", "area"), 3: ("cube root", "volume")}[dim]
    sizes = [in_unit(unit) * shown.of_elements(area(each.mesh) ** (1.0 / dim)) for each, shown in results]
    low, high = (float(bound(np.concatenate(sizes))) for bound in (np.min, np.max))
    label = f"size, {root} of the {measure}{f' ({unit})' if unit else ''}"
    qualities = [shown.of_elements(quality(each.mesh)) for each, shown in results]
    return [_scaled("quality (1: regular, 0: flat)", qualities, 0.0, 1.0), _scaled(label, sizes, low, high, "log")]


def _subdomains(results: Results) -> Shown:
    names: dict[str, int] = {}
    values = list[Ints]()
    for _, shown in results:
        number, labels = labelled(named_sets(shown.mesh.subdomains), shown.mesh.nelements)
        values.append(np.array([names.setdefault(text or NAMELESS, len(names)) for text in labels])[number])
    about = {"label": "subdomain", "kind": "values", "at": "element", "names": list(names)[: MOST_NAMES + 1]}
    return about, [packed(np.minimum(each, MOST_NAMES), "u1") for each in values]


def packed(values: ArrayLike, kind: str, *, coarse: bool = False) -> dict[str, str]:
    """Return arrays as base64 text of their bytes, shuffled and deflated.

    `kind` is ``"f4"``, ``"u4"`` or ``"u1"``, little-endian; `coarse` floats are rounded to 16 bits (1.5e-5 of each).
    Bytes of equal weight are stored together (the shuffle filter of HDF5), which compresses node numbers to a third.
    """
    with np.errstate(over="ignore"):  # overflow is drawn as the end of the scale
        flat = np.ravel(values).astype(f"<{kind}")
    if coarse:
        flat = ((flat.view(np.uint32) + np.uint32(0x80)) & np.uint32(0xFFFFFF00)).view(flat.dtype)
    planes = flat.view(np.uint8).reshape(-1, flat.dtype.itemsize).T
    return {"type": kind, "data": base64.b64encode(zlib.compress(planes.tobytes(), 6)).decode("ascii")}
