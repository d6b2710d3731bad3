"""Elements, boundary conditions, energy functionals and Newton's method."""
