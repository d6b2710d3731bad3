"""Curves and constraints of triangles."""
