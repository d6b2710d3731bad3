"""Report of an adaptation as one HTML file with an interactive view."""

from kohonen_adapt.report.scene import FieldOf
from kohonen_adapt.report.writing import write_report

__all__ = ["FieldOf", "write_report"]
