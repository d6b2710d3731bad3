"""Describe materials by their laws, and turn them into coefficients of a mesh."""
