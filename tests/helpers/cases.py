"""Cases of the command line as text, and sweeps of them without processes."""

from concurrent.futures import ThreadPoolExecutor

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


def without_processes(monkeypatch):
    """Have the command compute the cases of sweeps by a thread, for the rest of a test."""
    pool = lambda prepare, jobs: ThreadPoolExecutor(1)  # noqa: E731
    monkeypatch.setattr("kohonen_adapt.commands.sweep.LocalPool", pool)
