"""Public functions that work in the plane only say so of a mesh of tetrahedra, before they ask a problem anything."""

import matplotlib.pyplot as plt
import pytest
from helpers.solids import box

import kohonen_adapt as ka
from kohonen_adapt import plotting
from kohonen_adapt.magnetostatics import Magnetostatics, Material

MESH = box(2).with_subdomains({"core": lambda x: x[0] < 0.5, "air": lambda x: x[0] > 0.5})
NAMED = MESH.with_boundaries({"left": lambda x: x[0] == 0.0})
FIELD = Magnetostatics({"core": Material(1000.0), "air": Material()}, {"left": 0.0})


CALLS = {
    "adapt, of a field": lambda: ka.adapt(NAMED, FIELD),
    "solve": lambda: FIELD.solve(NAMED),
    "merge": lambda: ka.merge(NAMED, NAMED.translated((1.0, 0.0, 0.0))),
    "turned": lambda: ka.turned(NAMED, "core", 1.0),
    "plot_outlines": lambda: plotting.plot_outlines(NAMED),
}


@pytest.mark.parametrize("name", CALLS)
def test_tetrahedra_are_refused_in_words(name):
    with pytest.raises(
        ValueError, match=r"^mesh must be a skfem\.MeshTri( or MeshTri2)?; got MeshTet1\. This works in th"
    ):
        CALLS[name]()
    plt.close("all")
