"""Comparisons with other methods and programs."""
