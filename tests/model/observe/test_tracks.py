from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from model.bundle import TwinBundle
from model.errors import InputError
from model.observe.tracks import observe_tracks
from model.priors.materials import combine
from model.types import Camera, Masks, MaterialPrior, Tracks
from model.views import look_at

SIZE = (240, 320)
KEY = 1


@pytest.fixture
def bundle(twin_path: Path) -> TwinBundle:
    return TwinBundle.load(twin_path)


@pytest.fixture
def camera(bundle: TwinBundle) -> Camera:
    middle = bundle.topology.points.mean(axis=0).astype(np.float64)
    return look_at(middle + np.array([0.0, -0.6, 0.2]), middle, 500.0, SIZE[1], SIZE[0])


def _clip(bundle: TwinBundle, camera: Camera) -> tuple[np.ndarray, Tracks, Masks]:
    """Tracks of the near mass points as the twin itself moves, after one frame before the keyframe."""
    moved = bundle.rollout().points
    near = np.argsort(camera.project(bundle.topology.points)[1])[:9]
    pixels = camera.project(moved[:, near])[0].astype(np.float32)
    pixels = np.concatenate([pixels[:1], pixels])
    inside = np.ones((len(pixels), *SIZE), bool)
    tracks = Tracks(pixels, np.ones(pixels.shape[:2], bool))
    return moved[:, near], tracks, Masks(inside, ~inside, keyframe=KEY)


def _priors(bundle: TwinBundle) -> list[MaterialPrior]:
    even = np.full(10, 0.1)
    return [MaterialPrior(even, combine(even, "solid"), "solid")] * (int(bundle.topology.part.max()) + 1)


def test_what_moves_like_the_twin_is_seen_where_the_twin_is(bundle: TwinBundle, camera: Camera):
    moved, tracks, masks = _clip(bundle, camera)
    times = np.arange(len(moved)) / 30.0
    seen = observe_tracks(bundle, _priors(bundle), "solid", camera, tracks, masks, times)
    assert np.isfinite(seen.observation.points).all()
    np.testing.assert_allclose(seen.rest, seen.observation.points[0], atol=1e-4)
    # Gaussians beside the point on the keyframe are not exactly as deep as the point
    np.testing.assert_allclose(seen.observation.points, moved, atol=0.01)
    pixels = camera.project(seen.observation.points)[0]
    np.testing.assert_allclose(pixels, tracks.points[KEY:], atol=1e-2)


def test_what_is_hidden_is_not_seen(bundle: TwinBundle, camera: Camera):
    moved, tracks, masks = _clip(bundle, camera)
    visible = tracks.visible.copy()
    visible[3, 2] = False
    inside = masks.object.copy()
    x, y = np.round(tracks.points[4, 0]).astype(int)
    inside[4, y, x] = False
    times = np.arange(len(moved)) / 30.0
    masks = Masks(inside, ~inside, keyframe=KEY)
    seen = observe_tracks(
        bundle, _priors(bundle), "solid", camera, replace(tracks, visible=visible), masks, times
    )
    hidden = np.isnan(seen.observation.points).any(axis=2)
    assert hidden[3 - KEY, 2]
    assert hidden[4 - KEY, 0]


def test_a_mask_beside_the_twin_is_refused(bundle: TwinBundle, camera: Camera):
    moved, tracks, masks = _clip(bundle, camera)
    nothing = Masks(np.zeros_like(masks.object), masks.hand, keyframe=KEY)
    with pytest.raises(InputError, match="no point of the twin is seen"):
        observe_tracks(
            bundle, _priors(bundle), "solid", camera, tracks, nothing, np.arange(len(moved)) / 30.0
        )
