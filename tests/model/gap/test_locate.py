"""The gap is found where it was put, and nowhere where there is none."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest
import torch

from model.gap.bodies.body import body_of
from model.gap.effects import StrainStiffening, Viscoelasticity
from model.gap.locate import _innovations, locate
from model.gap.plain import PlainTwin
from model.gap.schema import Where

STIFF = {"strain_stiffening.stiffening": 2000.0}


def left(study):
    places = torch.from_numpy(study.plain.twin.body.points)
    return (places[:, 0] < 0.12).double()


@pytest.fixture
def halved(hung, studied):
    """What stiffens in its left half only."""
    return studied(hung, (StrainStiffening(),), STIFF, left(studied(hung)))


def test_shares_make_a_report(halved):
    found = locate(halved, halved.base)
    frames, points = halved.observation.points.shape[:2]
    where = Where(
        points=tuple(found.points),
        frames=tuple(found.frames),
        parts=found.parts,
        phases=found.phases,
        acts_on=points * (0.0,),
    )
    assert (len(where.points), len(where.frames)) == (points, frames)
    assert min(found.points) >= 0
    assert [part.part for part in found.parts] == ["near the grip", "middle", "far end"]


def test_it_is_where_it_was_put(halved):
    found = locate(halved, halved.base)
    on_left = halved.observation.points[0, :, 0] < 0.12
    assert found.points[on_left].mean() > 1.2 * found.points[~on_left].mean()
    assert found.chance < 0.01
    assert found.warnings == ()


def test_without_a_gap_it_is_nowhere(hung, studied):
    study = studied(hung)
    found = locate(study, study.base)
    assert found.chance > 0.05
    assert "p = " in found.warnings[0]
    np.testing.assert_allclose(found.points, 1 / len(found.points))
    np.testing.assert_allclose(found.frames, 1 / len(found.frames))


def test_parts_are_those_that_are_labelled(halved):
    labels = np.where(halved.observation.points[0, :, 0] < 0.12, 7, 3)
    found = locate(replace(halved, observation=replace(halved.observation, parts=labels)), halved.base)
    assert [part.part for part in found.parts] == [3, 7]
    assert found.parts[1].share > found.parts[0].share


def test_frames_that_no_fit_sees_count(hung, studied):
    """A gap that is only in the last frames."""
    study = studied(hung)
    points = study.observation.points.copy()
    points[32:, :, 0] += 0.02
    late = replace(study.observation, points=points)
    places = study.observer.places.clone()
    places[32:, :, 0] += 0.02
    study.observer.places = places
    found = locate(replace(study, observation=late), study.base)
    assert found.frames[32:].sum() > 0.9
    assert found.phases[-1].share > 0.5


def test_what_is_lost_is_as_far_off_whichever_way_it_is(hung, studied):
    """Along an axis or between all three: else shares would change as the world is turned."""
    study = studied(hung)
    for way in np.array([[1.0, 0.0, 0.0], [0.6, -0.8, 0.0], [1.0, 1.0, 1.0]]):
        observer = copy(study.observer)
        # far beyond what counts as lost, and not so far that a twin that follows becomes unstable
        off = 5.0 * study.observer.lost * torch.from_numpy(way / np.linalg.norm(way))
        observer.places = observer.places + off.to(observer.places)
        found = _innovations(replace(study, observer=observer), study.base)[0]
        lengths = np.linalg.norm(found[1], axis=-1)[study.seen[1]]
        np.testing.assert_allclose(lengths, study.observer.lost / study.misfit.noise, rtol=1e-3)


def test_turned_about_and_shuffled_it_is_the_same(hung, studied, study_of):
    """A turn about the vertical and another order of points give the same shares."""
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]], np.float32)
    order = np.random.default_rng(5).permutation(hung.points.shape[1])

    def other(seen):
        points = np.ascontiguousarray(seen.points[:, order] @ turn.T)
        return replace(seen, points=points, controllers=np.ascontiguousarray(seen.controllers @ turn.T))

    study = studied(hung, (Viscoelasticity(),), {"viscoelasticity.branch": 5.0}, noise=1e-6)
    still = other(hung)
    twin = PlainTwin.of(body_of(still), still)
    turned = study_of(other(study.observation), twin, study.start, 1e-6)
    found, again = locate(study, study.base), locate(turned, turned.base)
    # a sheet that swings freely tells one rounding error from another after a second
    assert 0.5 * np.abs(again.points - found.points[order]).sum() < 0.03
    assert 0.5 * np.abs(again.frames - found.frames).sum() < 0.03
    assert [phase.name for phase in again.phases] == [phase.name for phase in found.phases]
