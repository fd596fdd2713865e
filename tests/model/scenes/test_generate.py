import json
from functools import partial

import av
import cv2
import numpy as np
import pytest

from model.errors import InputError
from model.scenes import film
from model.scenes.files import load_folder
from model.scenes.generate import generate
from model.scenes.world.cases import draw_cases
from model.simulator.divergence import SimulationDiverged


def test_the_same_files_whatever_the_number_of_processes(tmp_path):
    shares = []
    for workers in (1, 2):
        folder = tmp_path / str(workers)
        generate(
            folder,
            2,
            seed=4,
            workers=workers,
            classes=("cloth",),
            interactions=1,
            report=lambda stage, share: shares.append(share),
        )
    one, two = ({p.name: p.read_bytes() for p in (tmp_path / w).iterdir()} for w in ("1", "2"))
    assert one == two
    assert len(load_folder(tmp_path / "1")) == 2
    assert shares[-1] == 1.0


def test_objects_are_the_same_in_any_folder_of_their_seed(tmp_path):
    generate(tmp_path / "both", 2, seed=4, classes=("cloth",), interactions=1)
    index = generate(tmp_path / "second", 1, seed=4, classes=("cloth",), interactions=1, first=1)
    name = index.cases[0].file
    assert (tmp_path / "both" / name).read_bytes() == (tmp_path / "second" / name).read_bytes()


@pytest.mark.slow
def test_films_show_the_colours_of_the_cases(tmp_path, monkeypatch):
    monkeypatch.setattr(film, "film_case", partial(film.film_case, size=(64, 48)))
    index = generate(tmp_path, 1, seed=4, classes=("cloth",), interactions=1, films=True)
    (case,) = load_folder(tmp_path)
    folder = tmp_path / "films" / case.name
    assert index.cases[0].file == f"{case.name}.case.npz"
    assert json.loads((folder / "film.json").read_text())["frames"] == len(case.observation.times)
    with av.open(str(folder / "film.mp4")) as container:
        picture = next(container.decode(video=0)).to_ndarray(format="rgb24")
    mask = cv2.imread(str(folder / "object" / "0000.png"), cv2.IMREAD_GRAYSCALE) > 0
    assert case.gaussians is not None
    painted = case.gaussians.colors.mean(axis=0)
    shown = picture[mask].mean(axis=0) / 255
    assert np.corrcoef(painted, shown)[0, 1] > 0.8


def test_what_was_interrupted_leaves_no_cases(tmp_path, monkeypatch):
    def stop(stage, share):
        if share > 0.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        generate(tmp_path, 2, classes=("cloth",), interactions=1, report=stop)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_with_cases_is_left_alone(tmp_path):
    (tmp_path / "a.case.npz").write_bytes(b"")
    with pytest.raises(InputError, match="has cases already"):
        generate(tmp_path, 1)


def test_a_world_that_flies_off_is_left_out_and_said(tmp_path, monkeypatch):
    from model.scenes.world import cases

    whole = cases.run_world

    def lost(*args):
        moved = whole(*args).copy()
        moved[7:, 0] += 1e6
        return moved

    monkeypatch.setattr(cases, "run_world", lost)
    with pytest.warns(
        UserWarning, match=r"0 of seed 4 is left out: .* in frame 7 a point is 1\.7e\+06 m from"
    ):
        index = generate(tmp_path, 1, seed=4, classes=("cloth",), interactions=1)
    assert not index.cases


def test_a_world_that_diverges_is_left_out_and_said(tmp_path, monkeypatch):
    from model.scenes.world import cases

    def diverge(seed, number, kind, interactions):
        if number == 0:
            raise SimulationDiverged(3, 0, "spring", 100)
        return draw_cases(seed, number, kind, interactions)

    monkeypatch.setattr(cases, "draw_cases", diverge)
    with pytest.warns(
        UserWarning, match="object 0 of seed 4 is left out: the simulation diverged in frame 3"
    ):
        index = generate(tmp_path, 2, seed=4, classes=("cloth",), interactions=1)
    assert len(index.cases) == 1
