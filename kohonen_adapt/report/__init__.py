"""A report of an adaptation: one HTML file that needs nothing else, with an interactive view of the meshes."""

from .scene import FieldOf
from .writing import write_report

__all__ = ["FieldOf", "write_report"]
