"""Compiled loops over arrays, without checks, mesh objects and files."""
