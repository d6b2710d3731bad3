"""Polish by descent of the energy of the discrete solution.

`polish` has the driver for triangles and tetrahedra. On triangles `plane_descent` sweeps and recycles, `functional` has
the functional with its data per element, `loops` calls the kernels, and `transfer` gives the function on a moved mesh.
"""
