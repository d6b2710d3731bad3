"""The polish: nodes move to where the energy of the solution is lower."""
