"""Script of a drawing that can only draw.

A drawing is a program of Gmsh, which may run other programs and write files. `Script` is the same program in one file,
if all of its words are known to be harmless: with the included files in place, without comments, and with one space
between words. Gmsh continues a loop or a macro at the start of a line, and finds the end of a branch that it skips by
its letters alone, so comments, long lines and quotation marks could otherwise make text a command.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from shutil import copyfile

from kohonen_adapt.cases.drawing_words import (
    CALLS,
    CONNECTORS,
    FIELDS,
    FILE_WORDS,
    MESSAGES,
    REFUSED,
    WORDS,
    may_set_option,
)

__all__ = ["Script"]

LARGEST = 10**7  # bytes of a drawing with its included files
LONGEST = 1000  # bytes of a word or string; Gmsh reads the rest of a string as commands after 1023
LINE_WIDTH = 2000  # bytes; Gmsh reads lines in parts of 8192
QUOTE_MARGIN = " " * 8  # Gmsh overlooks quotation marks in up to six letters after the beginning of "EndFor"

GEOMETRY = (".step", ".stp", ".iges", ".igs", ".brep", ".brp", ".xao", ".stl")
SCRIPTS = (".geo", ".geo_unrolled", ".pos")
HEADERS = {".msh": b"$MeshFormat", ".pos": b"$PostFormat"}  # of meshes and views, of equal length

TOKEN = re.compile(
    r"""(?P<space>[ \t\r\n\f]+|//[^\n]*|/\*.*?\*/)
    |(?P<string>"[^"]*"|'[^']*')
    |(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[Ee][-+]?[0-9]+)?)
    |(?P<word>[A-Za-z_][A-Za-z_0-9]*)
    |(?P<sign>\.\.\.|::|\|\||&&|\+\+|--|[-+*/=!<>]=|>>|<<|[-{}()\[\],;=+*/%^<>!&|?:.~\#])""",
    re.VERBOSE | re.DOTALL,
)
CONTROL = re.compile(r"(?:If|Else|For|Return)[0-9]")  # Gmsh ends a skipped branch within these names
CLOSING = {"(": ")", "[": "]", "{": "}"}
REMEDY = "If you trust who made the drawing, write trusted = true in the case."
SHOWN = 60  # characters of a word in a message
ASSIGNMENTS = ("=", "+=", "-=", "*=", "/=", "++", "--")


@dataclass(frozen=True)
class Token:
    kind: str
    text: str
    file: Path
    line: int

    def error(self, reason: str, remedy: str = f" {REMEDY}") -> ValueError:
        shown = "".join(letter if letter.isprintable() else "?" for letter in _decoded(self.text[:SHOWN]))
        return ValueError(f"'{self.file.name}', line {self.line}: {shown} {reason}{remedy}")


END = Token("end", "", Path(), 0)


@dataclass
class Script:
    """Harmless script of Gmsh, and the files to read.

    Attributes
    ----------
    tokens
        Words, numbers, strings and signs of the drawing and of its included files.
    copies
        Names of copies of the geometry and data files to the files.
    size
        Bytes of the drawing and of its included files.
    """

    tokens: list[Token] = field(default_factory=list)
    copies: dict[str, Path] = field(default_factory=dict)
    size: int = 0

    @classmethod
    def read(cls, drawing: Path) -> "Script":
        """Read a drawing with its included files.

        Raises
        ------
        ValueError
            If a file is missing, or a word or the path of a file is not known to be harmless.
        """
        script = cls()
        script._add(drawing.resolve(), drawing.resolve().parent, ())
        _Check(script.tokens)
        return script

    def write(self, path: Path) -> list[tuple[Path, int]]:
        # Returns the file and line of each line of the script.
        lines = list[str]()
        origins = list[tuple[Path, int]]()
        for token in self.tokens:
            origin = (token.file, token.line)
            if not lines or origins[-1] != origin or len(lines[-1]) > LINE_WIDTH:
                lines.append("")
                origins.append(origin)
            text = QUOTE_MARGIN + re.sub("[\r\n]", " ", token.text) if token.kind == "string" else token.text
            lines[-1] += f"{text} "
        path.write_text("\n".join([*lines, "", ""]), encoding="latin-1", newline="\n")
        for name, file in self.copies.items():
            copyfile(file, path.parent / name)
        return origins

    def _add(self, file: Path, root: Path, above: tuple[Path, ...]) -> None:
        self.size += file.stat().st_size + 1
        if self.size > LARGEST:
            raise ValueError(f"'{file.name}': a drawing has at most {LARGEST} bytes with all that it includes.")
        tokens = list(_tokens(file))
        k = 0
        while k < len(tokens):
            token = tokens[k]
            if token.text not in FILE_WORDS or token.kind != "word":
                self.tokens.append(token)
                k += 1
                continue
            name, end = _file_name(tokens, k)
            found = _file_below(root, name)
            if token.text == "Include" or (token.text.startswith("Merge") and _is_script(found, token)):
                if found in (file, *above):
                    raise name.error("includes itself.", remedy="")
                self._add(found, root, (file, *above))
            else:
                _check_alone(found)
                copy = f"{len(self.copies)}{found.suffix.lower()}"
                self.copies[copy] = found
                renamed = replace(name, text=f'"{copy}"')
                self.tokens += [renamed if each is name else each for each in tokens[k:end]]
            k = end


def _check_alone(file: Path) -> None:
    options = file.with_name(f"{file.name}.opt")
    if options.exists():
        raise ValueError(
            f"'{options.name}': Gmsh would run it after '{file.name}'; move its options into the drawing. {REMEDY}"
        )


def _tokens(file: Path) -> Iterator[Token]:
    _check_alone(file)
    text = file.read_bytes().decode("latin-1")
    position, line = 0, 1
    while position < len(text):
        found = TOKEN.match(text, position)
        if found is None or "\0" in found[0]:
            unknown = Token("", text[position], file, line)
            raise unknown.error("begins no word, number, closed string or closed comment.")
        token = Token(found.lastgroup or "", found[0], file, line)
        if token.kind != "space" and len(token.text) > LONGEST:
            raise token.error(f"... has more than {LONGEST} bytes.")
        if token.kind != "space":
            yield token
        line += token.text.count("\n")
        position = found.end()


def _decoded(text: str) -> str:
    return text.encode("latin-1").decode("utf-8", "surrogateescape")


def _file_name(tokens: Sequence[Token], k: int) -> tuple[Token, int]:
    opened = k + 1 < len(tokens) and tokens[k + 1].text in "(["
    name, last = [*tokens[k + 1 + opened : k + 3 + opened], END, END][:2]
    if name.kind != "string" or last.text != (CLOSING[tokens[k + 1].text] if opened else ";"):
        raise tokens[k].error("needs the name of a file in quotes, and nothing else.")
    return name, k + 3 + opened


def _file_below(root: Path, name: Token) -> Path:
    text = name.text[1:-1]
    if not text or text.startswith(("/", "~")) or ".." in text.split("/") or re.search(r"[\\:\r\n]", text):
        raise name.error("is not the relative path of a file below the folder of the drawing.")
    file = (name.file.parent / _decoded(text)).resolve()
    if not file.is_relative_to(root):
        raise name.error("is a link to a file outside of the folder of the drawing.")
    if not file.is_file():
        raise name.error("is not there.", remedy="")
    return file


def _is_script(file: Path, word: Token) -> bool:
    suffix = file.suffix.lower()
    with file.open("rb") as stream:
        header = stream.read(len(HEADERS[".msh"]))
    if suffix in GEOMETRY or HEADERS.get(suffix) == header:
        return False
    if suffix not in SCRIPTS:
        raise word.error(f"reads {', '.join((*GEOMETRY, *SCRIPTS))} and .msh; '{file.name}' is none of them.")
    return True


class _Check:
    # Every word must be known to be harmless, or be the name of a variable.

    def __init__(self, tokens: Sequence[Token]) -> None:
        self.tokens = tokens
        self.after_bracket = dict[int, int]()
        opened = list[int]()
        for k, token in enumerate(tokens):
            if token.text in CLOSING:
                opened.append(k)
            elif token.text in CLOSING.values() and opened:
                self.after_bracket[opened.pop()] = k + 1
        words = [k for k, token in enumerate(tokens) if token.kind == "word"]
        self.defined = {tokens[k].text for k in words if self.text(self.after_indices(k + 1)) in ASSIGNMENTS}
        for k in words:
            self.check_word(k)

    def at(self, k: int) -> Token:
        return self.tokens[k] if 0 <= k < len(self.tokens) else END

    def text(self, k: int) -> str:
        return self.at(k).text

    def after_indices(self, k: int) -> int:
        # Subscripts are (1), [] or ~{k}.
        while self.text(k) in ("(", "[", "~"):
            k = self.after_bracket.get(k + (self.text(k) == "~"), k + 1)
        return k

    def check_word(self, k: int) -> None:
        token, end = self.at(k), self.after_indices(k + 1)
        if CONTROL.search(token.text):
            raise token.error("is a name that Gmsh may take for the end of a branch; rename it.")
        if self.text(end) == "." and self.text(k - 1) != ".":
            self.check_option(k, end)
        elif token.text in MESSAGES:
            if self.text(self.after_bracket.get(k + 1, k)) != ";":
                raise token.error("may print to the terminal only, not to a file.")
        elif token.text == "Field" and self.text(end) == "=" and end > k + 1:
            given = self.tokens[min(end + 1, len(self.tokens) - 1)]  # a drawing may break off
            if given.text not in FIELDS:
                raise given.error("is not a type of field that is known to be harmless.")
        elif token.text not in WORDS:
            self.check_name(k)

    def check_name(self, k: int) -> None:
        token, before, after = self.at(k), self.text(k - 1), self.at(k + 1)
        if token.text in REFUSED and before != ".":
            raise token.error("is not among the words that a drawing may use.")
        if before in ("Macro", "Function"):
            as_name = after.kind != "string"
        else:
            as_name = after.kind not in ("string", "number") and (after.kind != "word" or after.text in CONNECTORS)
        called = after.text in ("(", "[") and token.text not in self.defined | CALLS and before != "."
        if not as_name or called or (after.text == "{" and before not in ("Color", "Delete")):
            raise token.error("is not a command that a drawing may use.")

    def check_option(self, k: int, dot: int) -> None:
        category, last = self.at(k), dot + 1
        option = self.text(last)
        last += 2 * (option == "Color" and self.text(last + 1) == ".")
        assigned = self.text(last + 1) in ASSIGNMENTS
        allowed = not assigned or category.text == "Field" or may_set_option(category.text, option)
        if not allowed or category.text in REFUSED - {"Print"}:
            raise category.error(f".{option} is not an option that a drawing may set.")
