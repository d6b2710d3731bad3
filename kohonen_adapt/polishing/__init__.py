"""Polish by descent of the energy of the discrete solution."""
