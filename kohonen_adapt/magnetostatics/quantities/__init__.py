"""What is computed from a solution: fields, forces, torques, linkages and goals."""
