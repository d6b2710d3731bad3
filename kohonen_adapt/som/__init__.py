"""The Kohonen map: a density of nodes in, a mesh with its nodes moved out."""
