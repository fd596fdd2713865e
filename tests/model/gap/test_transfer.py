"""The body of one recording in another of the same object."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from model.errors import InputError
from model.gap.carried import record_of
from model.gap.confirm import Fitted
from model.gap.effects import GravityTilt, GroundAdhesion
from model.gap.forecast import forecast
from model.gap.taken import points_of
from model.gap.transfer import transferred


@pytest.fixture
def sheet(hung, studied):
    return studied(hung)


def posed(observation, bent=0.0):
    """The same object turned over, shifted, and bent."""
    points = observation.points.astype(float)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])

    def put(places):
        bow = bent * np.stack([0 * places[..., 0], np.sin(9 * places[..., 0]), 0 * places[..., 0]], -1)
        return ((places + bow) @ turn.T + [0.5, 0.0, 0.3]).astype(np.float32)

    return replace(observation, points=put(points), controllers=put(observation.controllers.astype(float)))


@pytest.mark.parametrize("bent", [0.0, 0.02])
def test_mass_points_are_where_the_seen_points_say(sheet, bent):
    other = posed(sheet.observation, bent)
    found = transferred(sheet, other)
    made = found.twin.world(
        {
            name: sheet.plain.at(sheet.base.values).system.points.new_tensor(v)
            for name, v in sheet.base.values.items()
        }
    )
    seen = made.sight(found.state.positions).double().numpy()
    # told by all frames, of which most are bent: within three times the noise of the first
    assert np.abs(seen - other.points[0]).max() < 3e-3
    assert not found.state.velocities.any()
    np.testing.assert_array_equal(found.twin.body.points, sheet.plain.twin.body.points)
    np.testing.assert_array_equal(found.twin.matter.mass, sheet.plain.twin.matter.mass)
    ends = found.state.positions.double().numpy()[found.twin.body.springs]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    np.testing.assert_allclose(found.twin.matter.length, lengths, atol=1e-6)
    assert len(found.twin.body.grip) == len(sheet.plain.twin.body.grip)
    assert 0 < found.first < len(other.times) // 2 + 1


def test_a_point_that_is_hidden_at_first_is_no_obstacle(sheet):
    other = posed(sheet.observation)
    points = other.points.copy()
    points[:4, 10:20] = np.nan
    hidden = transferred(sheet, replace(other, points=points)).state.positions
    assert float((hidden - transferred(sheet, other).state.positions).abs().max()) < 0.02


@pytest.mark.parametrize("overlap", [0, 4])
def test_other_points_may_be_hidden_at_first_in_either_recording(sheet, overlap):
    """The left in one and the right in the other: what few are seen in both do not say how all lies."""
    seen, other = sheet.observation, posed(sheet.observation, 0.02)
    count = seen.points.shape[1]
    left, right = seen.points.copy(), other.points.copy()
    left[:3, : (count - overlap) // 2] = np.nan
    right[:3, (count + overlap) // 2 :] = np.nan
    hidden = replace(sheet, observation=replace(seen, points=left))
    found = transferred(hidden, replace(other, points=right)).state.positions
    away = (found - transferred(sheet, other).state.positions).norm(dim=1)
    assert float(away.mean()) < 0.2 * sheet.plain.twin.body.spacing


def test_points_that_turn_up_elsewhere_do_not_drag_the_body_along(sheet):
    """A corner that is hidden at first in both recordings, and taken for another place when it turns up."""
    other = posed(sheet.observation)
    points = other.points.copy()
    rest = sheet.observation.points[0]
    corner = np.linalg.norm(rest - rest[-1], axis=1) < 0.06
    assert corner.sum() >= 3
    points[:30, corner] = np.nan
    points[30:, corner] += 0.06
    hidden = transferred(sheet, replace(other, points=points)).state.positions
    assert float((hidden - transferred(sheet, other).state.positions).abs().max()) < 0.01


def test_the_hand_of_the_other_recording_is_its_own(sheet):
    found = transferred(sheet, posed(sheet.observation))
    assert {"grip", "reach", "prestress"} <= set(found.own)
    quantities = found.twin.quantities
    for name, value in found.own.items():
        low, high = quantities[name].bounds
        assert low <= value <= high
    assert not set(found.own) & {"stiffness", "damping", "drag_rate"}


def test_other_points_are_laid_on_the_body_by_its_shape(sheet):
    colors = np.nan_to_num(1e3 * np.abs(sheet.observation.points[0] * [0.8, 1.0, 1.2])).astype(np.uint8)
    sheet = replace(sheet, observation=replace(sheet.observation, colors=colors))
    other = posed(sheet.observation, 0.02)
    right = transferred(sheet, other)
    order = np.random.default_rng(5).permutation(other.points.shape[1])[:-12]
    with pytest.warns(UserWarning, match="was told by its shape alone"):
        found = transferred(sheet, points_of(other, order))
    away = (found.state.positions - right.state.positions).norm(dim=1)
    assert float(away.median()) < 0.3 * sheet.plain.twin.body.spacing
    made = found.twin.world({name: torch.tensor(value) for name, value in sheet.base.values.items()})
    shown = made.sight(found.state.positions).double().numpy()
    assert np.sqrt(np.mean((shown - other.points[0, order]) ** 2)) < 3e-3
    assert abs(len(found.twin.body.grip) - len(right.twin.body.grip)) <= 2
    assert (
        found.forecast(sheet.plain, sheet.base.values).error
        < 1.5 * right.forecast(sheet.plain, sheet.base.values).error
    )


def test_unseen_points_are_refused(sheet):
    points = sheet.observation.points.copy()
    points[:, 2:] = np.nan
    with pytest.raises(InputError, match="fewer than three"):
        transferred(sheet, replace(sheet.observation, points=points))


def test_what_is_held_elsewhere_is_held_anew(sheet):
    lower = sheet.observation.points[0][sheet.observation.points[0][:, 2] < -0.19]
    hands = np.repeat(lower[None], len(sheet.observation.times), 0)
    found = transferred(sheet, replace(sheet.observation, controllers=hands))
    held = found.twin.body.points[found.twin.body.grip[:, 1]]
    assert held[:, 2].max() < sheet.plain.twin.body.points[sheet.plain.twin.body.grip[:, 1]][:, 2].min()


def test_an_effect_that_the_twin_carries_is_left_out_where_it_cannot_act(sheet):
    """As what the ground does, of a recording in the air."""
    low = replace(sheet.observation, ground_height=float(np.nanmin(sheet.observation.points[..., 2])))
    sticky = (record_of(GroundAdhesion, {"pull_per_mass": 5.0, "reach": 0.01, "at_contact": 0.0}),)
    lying = replace(sheet.plain, twin=replace(sheet.plain.twin, observation=low, carried=sticky))
    assert "adhesion" in lying.at(sheet.start | {"friction": 0.5}).simulator.forces
    with pytest.warns(UserWarning, match="adhesion, which the twin carries, cannot act in the other"):
        found = transferred(replace(sheet, plain=lying), sheet.observation)
    hanging = found.hypothesis(lying)
    values = {name: quantity.start for name, quantity in hanging.quantities.items()}
    assert "adhesion" not in hanging.at(values).simulator.forces


@pytest.mark.parametrize("leads", [True, False])
def test_a_hand_that_leads_the_body_from_farther_than_it_reaches_holds_it(sheet, leads):
    """What it holds is hidden by it, in both recordings."""
    seen = sheet.observation
    times = seen.times[:, None, None]
    sway = 0.3 * np.concatenate([np.sin(4.0 * times), 0.0 * times, 0.0 * times], -1)
    upper, lowest = seen.controllers[:1], seen.points[0][:, 2].min()
    below = np.array([[[0.14, 0.0, lowest - 0.08], [0.16, 0.0, lowest - 0.08]]])
    hands = np.concatenate([upper + sway, below + (sway if leads else 0.0 * sway)], 1)
    moved = replace(
        seen,
        points=(seen.points[:1] + sway).astype(np.float32),
        controllers=hands.astype(np.float32),
    )
    found = transferred(sheet, moved)
    far = {hands.shape[1] - 2, hands.shape[1] - 1}
    assert (far <= set(found.twin.holders.tolist())) == leads


def test_a_point_that_the_first_recording_never_shows_is_where_the_other_has_it(sheet):
    """The body of the first has to have it somewhere."""
    twin = sheet.plain.twin
    points, index, weight = sheet.observation.points.copy(), twin.body.index.copy(), twin.body.weight.copy()
    points[:, 3], index[3], weight[3] = np.nan, 0, 1.0 / weight.shape[1]
    body = replace(twin.body, index=index, weight=weight)
    unknowing = replace(
        sheet,
        observation=replace(sheet.observation, points=points),
        plain=replace(sheet.plain, twin=replace(twin, body=body)),
    )
    found = transferred(unknowing, sheet.observation).twin.body
    place = (found.points[found.index[3]] * found.weight[3][:, None]).sum(0)
    assert np.linalg.norm(place - sheet.observation.points[0, 3]) < 5e-3


def test_an_effect_that_is_at_work_in_both_recordings_leaves_less_in_the_other(sheet):
    """The recording itself, as if it were another: what is not there does not help, parameters follow."""
    found = transferred(sheet, sheet.observation)
    plain = Fitted(
        sheet.misfit, sheet.base, forecast(sheet.observer, sheet.plain.at(sheet.base.values), sheet.split)
    )
    followed = found.followed(plain)
    left = found.further(followed).estimate.cost
    assert left <= followed.estimate.cost <= 1.2 * found.study(sheet).base.cost
    tilt = replace(sheet.plain, effects=(GravityTilt(),))
    misfit = sheet.misfit.of(tilt)
    values = {**sheet.base.values, "gravity_tilt.about_x": 0.4, "gravity_tilt.about_y": 0.0}
    vector = misfit.coordinates.vector(values)
    slopes = np.zeros((len(sheet.base.residuals), len(vector)))
    wrong = replace(sheet.base, values=values, vector=vector, jacobian=slopes)
    assert found.followed(Fitted(misfit, wrong, plain.foretold)).estimate.cost > 1.5 * left


@pytest.mark.parametrize(("bend", "roll"), [(0.0, 0.0), (1.2, 2.0), (-0.6, -1.0)])
def test_the_line_of_a_thick_rope_is_found_however_it_is_rolled_and_bent(bend, roll, thick_rope, studied):
    seen, _ = thick_rope(0, bend=0.0)
    other, middle = thick_rope(0, bend=bend, roll=roll)
    study = studied(seen)
    found = transferred(study, other)
    line = found.state.positions.double().numpy()
    assert cKDTree(middle).query(line)[0][2:-2].max() < 0.005
    assert found.twin.body.aside is not None
    there, here = (np.linalg.norm(np.diff(p, axis=0), axis=1) for p in (line, found.twin.body.points))
    assert np.abs(there / here - 1.0).max() < 0.15, "noise strains no spring so that a stiff rope flies apart"
    made = found.twin.world(
        {name: torch.tensor(value).double() for name, value in study.base.values.items()}, torch.float64
    )
    expected = made.sight(found.state.positions.double()).numpy()
    assert np.sqrt(np.mean((expected - other.points[0]) ** 2)) < 1.5e-3


def test_the_line_of_a_thick_rope_is_found_by_other_points_on_its_skin(thick_rope, studied):
    study = studied(thick_rope(0, bend=0.0)[0])
    other, middle = thick_rope(1, bend=1.2, roll=2.0, count=80)
    with pytest.warns(UserWarning, match="was told by its shape alone"):
        found = transferred(study, other)
    line = found.state.positions.double().numpy()
    assert cKDTree(middle).query(line)[0][2:-2].max() < 0.006
    made = found.twin.world(
        {name: torch.tensor(value).double() for name, value in study.base.values.items()}, torch.float64
    )
    shown = made.sight(found.state.positions.double()).numpy()
    assert np.sqrt(np.mean((shown - other.points[0]) ** 2)) < 1.5e-3


def test_each_twin_finds_for_itself_how_it_is_held_there(hung, studied):
    """A hand that the plain twin takes for elsewhere, since it knows of no tilt, misleads one that knows."""
    tilt = GravityTilt()
    values = {"gravity_tilt.about_x": 0.3, "gravity_tilt.about_y": -0.2}
    study = studied(hung, (tilt,), values)
    fast = replace(hung, controllers=hung.controllers + 0.5 * (hung.controllers - hung.controllers[:1]))
    other = transferred(study, studied(fast, (tilt,), values).observation)
    tilted, known = study.plain.with_effect(tilt), {**study.base.values, **values}
    taken = other.hypothesis(tilted).at(known | dict(other.own))
    misled = forecast(other.observer, taken, other.first, other.state)
    assert other.forecast(tilted, known).error < 0.85 * misled.error
