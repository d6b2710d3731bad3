"""State and solve the equations: symmetry, elements, conditions, energy, Newton's method."""
