"""Report an adaptation in one HTML file that needs nothing else, with an interactive view of the meshes."""

from kohonen_adapt.report.scene import FieldOf
from kohonen_adapt.report.writing import write_report

__all__ = ["FieldOf", "write_report"]
