"""Cases: what the command `run` is to do, as TOML."""

from .settings import Case, case_of, read_case
from .template import case_text

__all__ = ["Case", "case_of", "case_text", "read_case"]
