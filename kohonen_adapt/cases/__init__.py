"""Cases: what the command `run` is to do, as TOML."""

from .settings import Case, case_of, read_case

__all__ = ["Case", "case_of", "read_case"]
