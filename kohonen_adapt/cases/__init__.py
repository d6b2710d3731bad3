"""Cases, the input files (TOML) of the command ``run``."""

from kohonen_adapt.cases.case import Case
from kohonen_adapt.cases.checking import fitting_mesh
from kohonen_adapt.cases.reading import case_of, read_case
from kohonen_adapt.cases.template import case_text

__all__ = ["Case", "case_of", "case_text", "fitting_mesh", "read_case"]
