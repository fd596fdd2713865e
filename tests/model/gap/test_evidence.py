"""Inner products of what every probe changes: gathered by rollouts, the cause of a gap stands out in them."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.effects import GravityTilt, QuadraticAirDrag
from model.gap.evidence import BLOCKS, UNSHARED, Column, gather
from model.gap.heading import heading
from model.gap.misfit import Misfit, Span
from model.gap.observer import Observer
from model.gap.probes import probes
from model.gap.signs import SIGN_NAMES, signs_of

DRAG = {"quadratic_air_drag.drag_per_mass": 10.0}
TRIED = (QuadraticAirDrag(), GravityTilt())


@pytest.fixture(scope="module")
def rope(short, studied):
    """What swings in air that the twin does not have."""
    return studied(short, (QuadraticAirDrag(),), DRAG)


@pytest.fixture(scope="module")
def gathered(rope):
    told = []
    return gather(rope, TRIED, told.append), told


def test_columns_are_the_twins_the_sensors_the_hands_the_probes_and_the_innovations(rope, gathered):
    evidence, told = gathered
    assert evidence.kinds == ("twin", "sensor", "hand", "quadratic_air_drag", "gravity_tilt", "plain")
    names = [next(iter(evidence.columns[i].values)) for i in evidence.of("twin")]
    assert names == list(rope.misfit.coordinates.names)
    assert len(evidence.of("sensor")) == 12
    angle = heading(rope.plain.twin.body.points)
    for effect in TRIED:
        along = [effect.turned(each, angle) for each in probes(effect)]
        assert [evidence.columns[i].values for i in evidence.of(effect.name)] == along
    assert evidence.of("plain") == [len(evidence.columns) - 1]
    assert evidence.columns[-1] == Column("plain", {})
    assert told == [0.5, 1.0]


def test_all_frames_count_and_each_residual_once(rope, gathered):
    evidence, _ = gathered
    last = len(rope.observation.times) - 1
    misfit = Misfit(rope.plain, rope.observer, Span(0, last), rope.noise)
    plain = misfit(rope.base.vector[None])[0]
    assert evidence.grams.shape == (2 * BLOCKS, len(evidence.columns), len(evidence.columns))
    assert evidence.counts.sum() == len(plain)
    assert evidence.grams[:, -1, -1].sum() == pytest.approx((plain**2).sum())


def test_cells_are_of_time_and_of_distance_from_the_grip(rope, gathered):
    """The upper half of the rope is near; frames are in five groups, the first of which has one less."""
    evidence, _ = gathered
    frames = np.arange(1, len(rope.observation.times)) * BLOCKS // len(rope.observation.times)
    expected = np.repeat(3 * 4 * np.bincount(frames, minlength=BLOCKS), 2)
    np.testing.assert_array_equal(evidence.counts, expected)


def test_inner_products_are_of_real_columns(gathered):
    for gram in gathered[0].grams:
        np.testing.assert_allclose(gram, gram.T)
        size = np.sqrt(np.maximum(np.diag(gram), 1e-12))
        assert np.linalg.eigvalsh(gram / size / size[:, None]).min() > -1e-8


def test_what_is_missing_foretells_most(gathered):
    signs = signs_of(gathered[0], "rope", 2.0, False)
    foretold = dict(zip(signs.names, signs.each[:, SIGN_NAMES.index("foretold")], strict=True))
    assert foretold["quadratic_air_drag"] > 0.2
    assert foretold["quadratic_air_drag"] > foretold["gravity_tilt"] + 0.1


def test_where_nothing_is_missing_nothing_foretells(short, studied):
    signs = signs_of(gather(studied(short), TRIED), "rope", 1.0, False)
    assert signs.each[:, SIGN_NAMES.index("foretold")].max() < 0.1


def test_sensors_err_alike_wherever_the_origin_is(short, studied):
    """Also of points that are hidden at first, and of ones that are lost for a while."""
    sensed = []
    for way in (np.zeros(3, np.float32), np.array([5.0, -2.0, 1.0], np.float32)):
        moved = replace(short, points=short.points + way, controllers=short.controllers + way)
        study = studied(moved)
        points = study.observation.points.copy()
        points[0, 5], points[6:9, 2] = np.nan, np.nan
        seen = replace(study.observation, points=points)
        observer = Observer(seen, study.plain.at(study.start), study.observer.patience)
        misfit = Misfit(study.plain, observer, Span(0, len(seen.times) - 1), study.noise)
        evidence = gather(replace(study, observation=seen, observer=observer, misfit=misfit), ())
        sensor = evidence.of("sensor")
        sensed.append(evidence.grams[:, sensor][:, :, sensor])
    np.testing.assert_allclose(*sensed, rtol=0.02, atol=1e-3 * np.abs(sensed[0]).max())


def test_without_a_hand_there_is_no_column_of_one(short, studied):
    free = replace(short, controllers=short.controllers[:, :0])
    assert "hand" not in gather(studied(free), ()).kinds


def test_each_cell_counts_by_how_much_was_seen_in_it(gathered):
    evidence = gathered[0]
    weighed = evidence.weighed
    np.testing.assert_allclose(weighed.grams[:, -1, -1], weighed.counts, rtol=1e-9)
    np.testing.assert_allclose(weighed.weighed.grams, weighed.grams, rtol=1e-9)
    share = evidence.grams[3, 0, -1] / evidence.grams[3, -1, -1]
    assert weighed.grams[3, 0, -1] == pytest.approx(share * weighed.counts[3])


def test_of_two_recordings_effects_are_shared_and_the_twins_parameters_are_not(gathered):
    evidence = gathered[0]
    both = evidence.joined(evidence)
    own = sum(len(evidence.of(kind)) for kind in UNSHARED)
    assert len(both.columns) == len(evidence.columns) + own
    assert both.columns[-1].kind == "plain"
    assert both.of("gravity_tilt") == evidence.of("gravity_tilt")
    first, other = both.grams[: 2 * BLOCKS], both.grams[2 * BLOCKS :]
    for kind in ("gravity_tilt", "plain"):
        there, here = both.of(kind), evidence.of(kind)
        for grams in (first, other):
            np.testing.assert_array_equal(grams[:, there][:, :, [-1]], evidence.grams[:, here][:, :, [-1]])
    twin = both.of("twin")
    half = len(evidence.of("twin"))
    assert not other[:, twin[:half]].any()
    assert not first[:, twin[half:]].any()
    np.testing.assert_array_equal(other[:, twin[half:], -1], evidence.grams[:, evidence.of("twin"), -1])


def test_two_recordings_of_one_effect_tell_it_as_one_does(rope, gathered):
    evidence = gathered[0]
    alone = signs_of(evidence, "rope", rope.base.cost, ground=False)
    both = signs_of(evidence.joined(evidence), "rope", rope.base.cost, ground=False)
    gain = SIGN_NAMES.index("gain")
    np.testing.assert_allclose(both.each[:, gain], alone.each[:, gain], atol=3e-3)
    assert both.scale[0] == pytest.approx(alone.scale[0], rel=0.05)


def test_what_only_the_other_recording_can_show_is_left_out(gathered):
    evidence = gathered[0]
    less = replace(
        evidence,
        columns=tuple(c for c in evidence.columns if c.kind != "gravity_tilt"),
        grams=np.delete(
            np.delete(evidence.grams, evidence.of("gravity_tilt"), 1), evidence.of("gravity_tilt"), 2
        ),
    )
    assert "gravity_tilt" not in less.joined(evidence).kinds
    assert "gravity_tilt" in evidence.joined(less).kinds
