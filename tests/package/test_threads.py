"""No result depends on the number of threads, which numba fixes when it is imported."""

import json

import pytest
from helpers.parted import RESULTS, texts
from helpers.processes import output_with

from kohonen_adapt.kernels.threads import LIGHT, parts_for
from kohonen_adapt.som.training import STRIPS

SCRIPT = "import json; from helpers.parted import texts; print(json.dumps(texts()))"


@pytest.mark.slow
def test_any_number_of_threads_gives_the_same_bits():
    """On meshes of several parts: those of this process, one, and more than there are cores."""
    here = texts()
    alone, crowd = (json.loads(output_with(SCRIPT, NUMBA_NUM_THREADS=number)) for number in ("1", "5"))
    assert here == alone == crowd and len(here) == len(RESULTS)
    nodes, elements = ({name: int(text.split()[k]) for name, text in here.items()} for k in (0, 1))
    assert parts_for(nodes["relocated"], 10, 2, STRIPS) > 1 and nodes["relocated"] > 2 * LIGHT
    assert elements["on_curves"] > 10_000
