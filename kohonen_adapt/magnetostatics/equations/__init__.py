"""The equations of magnetostatics: symmetry, conditions, assembly and solution."""
