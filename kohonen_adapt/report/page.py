"""HTML page of a report, with escaped text and a strict content security policy."""

import base64
import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.loop.table import html_table

__all__ = ["filled_page"]

SCRIPTS = ("meshes.js", "layer.js", "legend.js", "view.js")
SIGNATURES = {b"\x89PNG\r\n\x1a\n": "png", b"GIF8": "gif"}


def filled_page(
    *,
    title: str,
    summary: Iterable[str],
    figures: Iterable[tuple[str, str]],
    result: AdaptResult,
    held: Sequence[tuple[str, ...]],
    pictures: Mapping[str, bytes],
    settings: Mapping[str, str],
    versions: Mapping[str, str],
    data: Mapping[str, Any],
) -> bytes:
    """Return the page of a report.

    Parameters
    ----------
    held
        Reason, and the number of nodes before and after.
    pictures
        Caption to the bytes of a PNG or GIF file.
    settings, versions
        Texts of any length, and short texts, by name.
    data
        Data of the view, ready for JSON.

    Raises
    ------
    ValueError
        If a picture is neither PNG nor GIF.
    """
    style, script = _part("style.css"), "\n".join(_part(name) for name in SCRIPTS)
    sources = [(caption, _source(caption, content)) for caption, content in pictures.items()]
    filled = Template(_part("page.html")).substitute(
        policy=_policy(style, script),
        title=escape(title),
        generator=escape(f"kohonen_adapt {versions.get('kohonen_adapt', '')}"),
        style=style,
        summary=_each("<p>{}</p>", ((sentence,) for sentence in summary)),
        figures=_each("<div><dt>{}</dt><dd>{}</dd></div>", figures),
        passes=html_table(result.history, [' class="result"' * (step is result.best) for step in result.history]),
        held=_each('<tr><th scope="row">{}</th><td>{}</td><td>{}</td></tr>', held),
        without_held="" if held else " hidden",
        pictures=_each('<figure><img src="{1}" alt="{0}"><figcaption>{0}</figcaption></figure>', sources),
        without_pictures="" if pictures else " hidden",
        settings=_each("<h3>{}</h3>\n<pre>{}</pre>", settings.items()),
        versions=_each("<dt>{}</dt><dd>{}</dd>", versions.items()),
        data=_json(data),
        script=script,
    )
    return filled.encode("utf-8", "replace")  # for unpaired surrogates in names


def _part(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def _each(form: str, rows: Iterable[tuple[str, ...]]) -> str:
    return "\n".join(form.format(*map(escape, row)) for row in rows)


def _policy(style: str, script: str) -> str:
    allowed = f"style-src {_hash(style)}; script-src {_hash(script)}; img-src data:"
    return f"default-src 'none'; {allowed}; base-uri 'none'; form-action 'none'"


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _json(data: Mapping[str, Any]) -> str:
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _source(caption: str, content: bytes) -> str:
    kind = next((kind for start, kind in SIGNATURES.items() if content.startswith(start)), None)
    if kind is None:
        raise ValueError(f"pictures must be PNG or GIF files; '{caption}' begins with {content[:8]!r}.")
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"
