"""Settings of the documentation site.

Build the site with `sphinx-build -W -b html kohonen_adapt/docs site` and the dependency group docs.
"""

import os
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from sphinx.application import Sphinx
from sphinx.errors import SphinxError

from kohonen_adapt.version import __version__

DOCS = Path(__file__).parent
PAGES = {  # READMEs that are pages here, or parts of one: links to them lead there
    "README.md": "index.md",
    "examples/README.md": "gallery.md",
    "benchmarks/README.md": "measured.md",
    "kohonen_adapt/README.md": "how_it_works.md",
    "kohonen_adapt/CHANGELOG.md": "changes.md",
}

project, author, copyright = "kohonen-adapt", "The kohonen-adapt founders", "the kohonen-adapt founders"
version = release = __version__
language = "en-GB"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
myst_heading_anchors = 3

autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # nested unions of arrays are longer than the shapes and units in docstrings
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_attr_annotations = False
napoleon_use_ivar = True  # no second entry for attributes that are properties
default_role = "py:obj"  # names between single backticks are links

html_theme = "furo"
html_title = f"kohonen-adapt {__version__}"
html_copy_source = False


def links_from_here(app: Sphinx, path: Path, _parent: str, content: list[str]) -> None:
    """Replace the links of an included README by links to pages or files."""
    folder = (DOCS / path).resolve().parent

    def from_here(link: re.Match[str]) -> str:
        target = (folder / link[1]).resolve()
        page = PAGES.get(os.path.relpath(target, DOCS.parents[1]))
        return f"]({page or os.path.relpath(target, DOCS)}{link[2] or ''})"

    content[0] = re.sub(r"\]\(([^)#:\s]+)(#[^)\s]*)?\)", from_here, content[0])


class Page(HTMLParser):
    def __init__(self, file: Path) -> None:
        super().__init__()
        self.anchors, self.links = {""}, set[str]()
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        given = dict(attributes)
        self.anchors |= {value for key in ("id", "name") if (value := given.get(key))}
        self.links |= {value for key in ("href", "src") if (value := given.get(key))}


def dead_links(folder: Path) -> list[str]:
    """Return links within the site without a file or anchor, each with its page."""
    pages = {file: Page(file) for file in folder.rglob("*.html")}
    dead = []
    for file, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
            found = target in pages and unquote(parts.fragment) in pages[target].anchors
            if not (parts.scheme or found or (target not in pages and target.is_file())):
                dead.append(f"{file.relative_to(folder)}: {link}")
    return sorted(dead)


def check_links(app: Sphinx, exception: Exception | None) -> None:
    """Refuse a site that is built, but has dead links.

    Raises
    ------
    SphinxError
        If there are any, with the list of them.
    """
    if exception is None and app.builder.name == "html" and (dead := dead_links(Path(app.outdir).resolve())):
        raise SphinxError("\n".join(["dead links:", *dead]))


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("include-read", links_from_here)
    app.connect("build-finished", check_links)
    return {"parallel_read_safe": True}
