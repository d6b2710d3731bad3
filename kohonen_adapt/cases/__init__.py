"""Read and write cases: the TOML that tells the command `run` what to do."""

from kohonen_adapt.cases.settings import Case, case_of, read_case
from kohonen_adapt.cases.template import case_text

__all__ = ["Case", "case_of", "case_text", "read_case"]
