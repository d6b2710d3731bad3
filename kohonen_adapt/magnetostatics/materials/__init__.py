"""Materials, B-H laws, and coefficients of the elements of a mesh."""
