"""What objects of a folder of scenes are taken for."""

from dataclasses import replace

import numpy as np

from benchmarks.gap.shapes import told
from model.scenes.files import save_case, write_index


def test_one_side_of_a_bar_that_lies_is_told_by_what_bears_it(make_case, tmp_path):
    case = make_case(frames=3)
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(-0.15, 0.15, 12), np.linspace(-0.1, 0.1, 8)))
    half = np.stack([x, y, 0.1 - 1.5 * x**2 - 3.0 * y**2], -1)
    seen = np.repeat(half[None].astype(np.float32), 3, 0)
    count = case.observation.points.shape[1]
    low = replace(case.observation, points=np.resize(seen, (3, count, 3)), ground_height=0.0)
    for name, observation in (("foam-1-1-lift", case.observation), ("foam-1-2-lift", low)):
        save_case(replace(case, name=name, observation=observation), tmp_path / f"{name}.case.npz")
    write_index(tmp_path)
    counts = told(tmp_path, None)
    assert sum(counts.values()) == 2
    assert told(tmp_path, 1).total() == 1
    assert all(key[0] == case.object_class and key[1] == case.shape_class for key in counts)
    assert any(key[2:] == ("sheet", "solid") for key in counts)
