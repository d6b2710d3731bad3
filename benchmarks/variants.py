"""The ways to use this package that the comparisons run."""

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Variant:
    """One way to call `adapt`; `key` names its targets and `options` are keywords of `adapt`."""

    key: str
    name: str
    passes: int
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """As a row of a table is called."""
        return f"{self.name} ({self.passes} passes)"


FIXED = Variant("fixed", "map, fixed", 3, {"topology": "fixed"})
FLIP = Variant("flip", "map, flip", 4, {"topology": "flip"})
VARIANTS = (FIXED, FLIP)
DEFAULT = FLIP
