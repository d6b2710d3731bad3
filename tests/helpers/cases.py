"""Cases of the command line as text."""

INSET = """
mesh = "mesh.msh"
scale = 1e-3
[materials.core]
permeability = 1000.0
remanence = [0.0, 1.2]
[materials.air]
[potential]
outer = 0.0
[adapt]
passes = 2
[outputs.stored]
quantity = "energy"
"""
