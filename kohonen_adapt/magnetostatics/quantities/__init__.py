"""Derive fields, forces, torques, linkages and goals from a solution."""
