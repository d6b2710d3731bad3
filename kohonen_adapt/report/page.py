"""Fill the page of a report: every text escaped, and a policy that lets nothing in or out."""

import base64
import hashlib
import json
from collections.abc import Iterable, Mapping
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.loop.table import table_columns

__all__ = ["filled_page"]

SCRIPTS = ("meshes.js", "layer.js", "legend.js", "view.js")
SIGNATURES = {b"\x89PNG\r\n\x1a\n": "png", b"GIF8": "gif"}


def filled_page(
    *,
    title: str,
    generator: str,
    summary: Iterable[str],
    figures: Iterable[tuple[str, str]],
    result: AdaptResult,
    pictures: Mapping[str, bytes],
    settings: Mapping[str, str],
    versions: Mapping[str, str],
    data: Mapping[str, Any],
) -> bytes:
    """The whole file.

    Parameters
    ----------
    title, generator
        Of the page, and what made it.
    summary, figures
        Sentences, and names with values to look at first.
    result
        Whose passes make the table.
    pictures
        Caption to a PNG or GIF file.
    settings, versions
        Name to a text of any length, and to a short one.
    data
        What the view shows, ready for JSON.

    Raises
    ------
    ValueError
        If a picture is neither PNG nor GIF.
    """
    style, script = _part("style.css"), "\n".join(_part(name) for name in SCRIPTS)
    filled = Template(_part("page.html")).substitute(
        policy=_policy(style, script),
        title=escape(title),
        generator=escape(generator),
        style=style,
        summary=_paragraphs(summary) + _figures(figures),
        passes=_table(result),
        pictures=_gallery(pictures),
        settings=_settings(settings) + _versions(versions),
        data=_json(data),
        script=script,
    )
    return filled.encode("utf-8", "replace")  # half a surrogate pair in a name is no character


def _part(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def _policy(style: str, script: str) -> str:
    """Only this style and this script may act, by their hashes; nothing may be fetched or sent."""
    allowed = f"style-src {_hash(style)}; script-src {_hash(script)}; img-src data:"
    return f"default-src 'none'; {allowed}; base-uri 'none'; form-action 'none'"


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _json(data: Mapping[str, Any]) -> str:
    """JSON that cannot end the element it stands in."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _paragraphs(sentences: Iterable[str]) -> str:
    return "\n".join(f"<p>{escape(sentence)}</p>" for sentence in sentences)


def _figures(figures: Iterable[tuple[str, str]]) -> str:
    pairs = "".join(f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in figures)
    return f'\n<dl class="figures">{pairs}</dl>'


def _table(result: AdaptResult) -> str:
    """All columns that printing shows, side by side."""
    columns = [column for group in table_columns(result.history) for column in group]
    head = "".join(f'<th scope="col">{escape(title)}</th>' for title, _ in columns)
    rows = [_row([cells[k] for _, cells in columns], step is result.best) for k, step in enumerate(result.history)]
    body = "\n".join(rows)
    return (
        '<div class="wide" tabindex="0" role="region" aria-labelledby="passes-title">\n'
        f"<table><thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table>\n</div>\n"
        '<p class="note">The marked row is the result; pass 0 is the mesh that came in.</p>'
    )


def _row(cells: Iterable[str], marked: bool) -> str:
    filled = "".join(f"<td>{escape(cell)}</td>" for cell in cells)
    return f'<tr class="result">{filled}</tr>' if marked else f"<tr>{filled}</tr>"


def _gallery(pictures: Mapping[str, bytes]) -> str:
    if not pictures:
        return ""
    shown = "\n".join(_picture(caption, content) for caption, content in pictures.items())
    return (
        '<section aria-labelledby="pictures-title" id="pictures">\n<h2 id="pictures-title">Pictures</h2>\n'
        f'<div class="gallery">\n{shown}\n</div>\n</section>'
    )


def _picture(caption: str, content: bytes) -> str:
    kind = next((kind for start, kind in SIGNATURES.items() if content.startswith(start)), None)
    if kind is None:
        raise ValueError(f"pictures must be PNG or GIF files; '{caption}' begins with {content[:8]!r}.")
    source = f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"
    text = escape(caption)
    image = f'<img src="{source}" alt="{text}">'
    return f"<figure>{image}<figcaption>{text}</figcaption></figure>"


def _settings(settings: Mapping[str, str]) -> str:
    return "".join(f"<h3>{escape(name)}</h3>\n<pre>{escape(text)}</pre>\n" for name, text in settings.items())


def _versions(versions: Mapping[str, str]) -> str:
    pairs = "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in versions.items())
    return f'<h3>Versions</h3>\n<dl class="versions">{pairs}</dl>'
