"""Fields, forces, flux linkages and goals from a solution."""
