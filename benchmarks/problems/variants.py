"""Name the ways to use this package that the comparisons run."""

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Variant:
    """One way to call `adapt`: `key` names its targets, `options` are keywords of `adapt`.

    `numbering`: what becomes of the numbers of the nodes.
    """

    key: str
    name: str
    passes: int
    options: dict[str, Any] = field(default_factory=dict)
    numbering: str = "kept"

    @property
    def title(self) -> str:
        """As a row of a table is called."""
        return f"{self.name} ({self.passes} passes)"


FIXED = Variant("fixed", "map only, fixed", 3, {"topology": "fixed", "polish": False})
FLIP = Variant("flip", "map only, flip", 4, {"topology": "flip", "polish": False})
POLISHED = Variant("polish", "map + polish, flip", 4, {"topology": "flip"})
DEFAULT = Variant("recycle", "default (recycle)", 3, numbering="in `nodes`")
LOOSE = Variant("loose", "default, min quality 0.1", 3, {"min_quality": 0.1}, "in `nodes`")
VARIANTS = (FIXED, FLIP, POLISHED, DEFAULT)
WITHOUT_POLISH = (FIXED, FLIP, DEFAULT)
