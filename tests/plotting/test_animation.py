"""Moving pictures: a frame for every pass or epoch, whole or not there, and the map trained as it says."""

import numpy as np
import pytest
from helpers.meshes import square
from helpers.places import names_in
from helpers.reports import a_pass
from PIL import Image
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import plotting


def passes(count, mesh=None):
    return [a_pass(k, mesh or MeshTri().refined(2), 1.0 / (k + 1)) for k in range(count)]


def durations(path):
    """Milliseconds of every frame."""
    with Image.open(path) as film:
        found = []
        for k in range(film.n_frames):
            film.seek(k)
            found.append(film.info["duration"])
        return found


def test_every_pass_is_a_frame_and_the_last_stays(tmp_path):
    plotting.animate_passes(tmp_path / "passes.gif", passes(3), unit="mm", seconds=0.5)
    shown = durations(tmp_path / "passes.gif")
    assert shown[:2] == [500, 500] and sum(shown[2:]) == 500 + 2000
    assert names_in(tmp_path) == ["passes.gif"]


@pytest.mark.slow
def test_of_many_passes_sixty_are_shown(tmp_path):
    plotting.animate_passes(tmp_path / "passes.gif", passes(61, MeshTri().scaled((1.0, 0.1))), seconds=1.0)
    assert sum(durations(tmp_path / "passes.gif")) == 60_000 + 2000


def test_a_map_is_trained_epoch_by_epoch(tmp_path):
    mesh = square(5)
    points = np.random.default_rng(1).uniform(0.0, 0.5, (2, 80))
    schedule = ka.Schedule((ka.Stage(1, 2, (0.4, 0.2)), ka.Stage(0, 1, 0.1)), fresh=False)
    som, twin = ka.KohonenMap(mesh), ka.KohonenMap(mesh)
    errors = plotting.animate_map(tmp_path / "map.gif", som, points, schedule, seed=3)
    wanted = [
        twin.train(points, ka.Schedule((stage,)), seed=3 + k)[0]
        for k, stage in enumerate([ka.Stage(1, 1, 0.4), ka.Stage(1, 1, 0.2), ka.Stage(0, 1, 0.1)])
    ]
    assert list(errors) == wanted and np.array_equal(som.mesh.p, twin.mesh.p)
    assert np.mean(som.mesh.p < 0.5) > np.mean(mesh.p < 0.5)
    assert sum(durations(tmp_path / "map.gif")) == 4 * 250 + 1750


def test_points_that_are_not_fresh_are_drawn_once(tmp_path):
    asked = []

    def draw(number, rng):
        asked.append(number)
        return rng.uniform(0.0, 1.0, (2, number)), None

    som = ka.KohonenMap(MeshTri().refined(2))
    errors = plotting.animate_map(tmp_path / "map.gif", som, draw, ka.Schedule.paper(epochs=(1, 1, 1)))
    assert len(errors) == 3 and asked == [50]


def test_a_tolerance_ends_the_training(tmp_path):
    points = np.random.default_rng(1).uniform(0.0, 1.0, (2, 50))
    schedule = ka.Schedule((ka.Stage(0, 9, 0.1),), tolerance=1.0)
    som = ka.KohonenMap(MeshTri().refined(2))
    assert len(plotting.animate_map(tmp_path / "map.gif", som, points, schedule)) == 1


def test_wrong_arguments_leave_no_file(tmp_path):
    path, som = tmp_path / "film.gif", ka.KohonenMap(MeshTri().refined(2))
    with pytest.raises(ValueError, match="an animation needs a mesh at least; got none"):
        plotting.animate_passes(path, [])
    with pytest.raises(ValueError, match="seconds must be above zero; got 0"):
        plotting.animate_passes(path, passes(1), seconds=0)
    with pytest.raises(ValueError, match="unit must be one of"):
        plotting.animate_passes(path, passes(1), unit="inch")
    with pytest.raises(ValueError, match=r"schedule must be a kohonen_adapt\.Schedule"):
        plotting.animate_map(path, som, np.full((2, 1), 0.5), "paper")
    with pytest.raises(ValueError, match="train has no density to sweep with"):
        plotting.animate_map(path, som, np.full((2, 1), 0.5), ka.Schedule((ka.Stage(0, 1, 0.1),), sweeps=1))
    assert list(tmp_path.iterdir()) == []
