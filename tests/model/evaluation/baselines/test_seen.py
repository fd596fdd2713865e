from dataclasses import replace

import numpy as np
import pytest
import torch

from model.errors import InputError
from model.evaluation.baselines.seen import Seen, last_seen
from model.types import Camera


def test_the_loss_is_what_its_words_say(make_case):
    case = make_case(frames=6)
    seen = Seen.of(case)
    offset = torch.tensor([0.003, 0.0, 0.0])
    made = seen.points + offset
    track = 0.5 * 3.0**2 / 3
    apart = torch.cdist(seen.points[1:], made[1:]).min(dim=-1).values
    chamfer = float(apart.square().mean()) * 1e6
    assert float(seen.loss(made, chamfer=0.0)) == pytest.approx(track, rel=1e-3)
    assert float(seen.loss(made)) == pytest.approx(track + chamfer, rel=1e-3)
    assert float(seen.loss(seen.points)) == 0.0


def test_what_is_not_seen_does_not_count(make_case):
    case = make_case(frames=6)
    made = torch.as_tensor(case.observation.points[: case.split]).clone()
    case.observation.points[2, 5] = np.nan
    made[2, 5] += 1.0
    assert float(Seen.of(case).loss(made, chamfer=0.0)) == 0.0


def test_gradients_pull_towards_what_is_seen(make_case):
    seen = Seen.of(make_case(frames=6))
    offset = torch.tensor([0.002, 0.0, 0.0], requires_grad=True)
    seen.loss(seen.points + offset).backward()
    assert offset.grad is not None
    assert float(offset.grad[0]) > 0


def test_with_one_camera_depth_does_not_count(make_case):
    case = make_case(frames=6)
    pose = np.eye(4)
    pose[:3, 3] = (0.0, 0.0, -1000.0)
    seen = Seen.of(replace(case, camera=Camera(np.eye(3), pose, 10, 10)))
    deeper = seen.points + torch.tensor([0.0, 0.0, 0.01])
    assert float(seen.loss(deeper, chamfer=0.0)) < 1e-3
    assert float(seen.loss(seen.points + torch.tensor([0.01, 0.0, 0.0]), chamfer=0.0)) > 1.0


def test_nothing_seen_is_refused(make_case):
    case = make_case(frames=6)
    case.observation.points[1:] = np.nan
    with pytest.raises(InputError, match="nothing to fit"):
        Seen.of(case)
    assert np.array_equal(last_seen(case), case.observation.points[0])
