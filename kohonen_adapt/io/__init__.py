"""Read and write mesh files of Gmsh and other programs, with named groups."""

from kohonen_adapt.io.content import MSH_VERSION
from kohonen_adapt.io.elmer import HEADER
from kohonen_adapt.io.fields import FIELD_SUFFIXES, read_field
from kohonen_adapt.io.groups import Groups
from kohonen_adapt.io.read import read_curves, read_groups, read_mesh
from kohonen_adapt.io.write import WRITTEN, check_names_written, write_mesh

__all__ = [
    "FIELD_SUFFIXES",
    "HEADER",
    "MSH_VERSION",
    "WRITTEN",
    "Groups",
    "check_names_written",
    "read_curves",
    "read_field",
    "read_groups",
    "read_mesh",
    "write_mesh",
]
