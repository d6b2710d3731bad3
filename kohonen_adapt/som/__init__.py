"""Kohonen map that moves the nodes of a mesh to a given density."""
