"""Energy descent on tetrahedra."""
