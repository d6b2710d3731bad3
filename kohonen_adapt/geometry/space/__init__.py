"""Surfaces and constraints of tetrahedra."""
