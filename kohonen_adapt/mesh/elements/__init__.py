"""Finite element functions of every order on triangles and tetrahedra."""
