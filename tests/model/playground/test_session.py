import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from model.errors import InputError
from model.playground.session import WITHOUT, Session
from model.types import Parameter


def test_the_recorded_motion_is_that_of_a_rollout(plain_twin, steps):
    expected = plain_twin.rollout().points
    session = Session(plain_twin)
    session.play()
    for frame in range(1, len(expected)):
        moment = session.step()
        np.testing.assert_allclose(moment.points[0], expected[frame], atol=1e-6)
    assert moment.motion == pytest.approx((len(expected) - 1) / 30)


def test_a_click_makes_a_control_point_that_rides_along(session, steps, above):
    top = int(session.moment.points[0][:, 2].argmax())
    session.grab(0, *above(session.moment.points[0][top]))
    session.free()
    moment = steps(session, 5)
    (grip,) = moment.grips
    assert grip.point == top
    assert not grip.holds
    falling = session.actors[0].positions[top]
    np.testing.assert_allclose(steps(session, 1).grips[0].place, falling, atol=1e-6)
    session.grab(0, *above([9.0, 9.0, 0.0]))
    assert len(steps(session, 1).grips) == 1


def test_the_object_follows_a_drag_and_falls_when_it_ends(session, steps, above):
    session.free()
    before = steps(session, 1).points[0]
    session.grab(0, *above(before[before[:, 2].argmax()]))
    grip = steps(session, 1).grips[0]
    goal = grip.place + np.array([0.1, 0.05, 0.2])
    session.drag(grip.number, goal)
    moment = steps(session, 60)
    assert np.linalg.norm(moment.points[0][grip.point] - goal) < 0.02
    assert moment.points[0].mean(axis=0)[2] > before.mean(axis=0)[2] + 0.1
    session.drop(grip.number)
    fallen = steps(session, 10)
    assert not fallen.grips[0].holds
    assert fallen.points[0].mean(axis=0)[2] < moment.points[0].mean(axis=0)[2] - 0.05


def test_a_pinned_point_holds_until_it_is_let_go(session, steps, above):
    session.free()
    before = steps(session, 1).points[0]
    session.grab(0, *above(before[before[:, 2].argmax()]))
    number = steps(session, 1).grips[0].number
    session.pin(number, True)
    held = steps(session, 60)
    assert np.linalg.norm(held.points[0][held.grips[0].point] - held.grips[0].place) < 0.02
    session.drag(number, held.grips[0].place + np.array([0.0, 0.0, 0.1]))
    session.drop(number)
    assert steps(session, 1).grips[0].holds
    session.let_go()
    gone = steps(session, 10)
    assert gone.grips == ()
    assert gone.points[0].mean(axis=0)[2] < held.points[0].mean(axis=0)[2] - 0.05


def test_the_hand_lets_go_and_takes_hold_again(session, steps):
    held = steps(session, 20)
    assert held.hand
    assert len(held.hands[0]) == 2
    session.free()
    falling = steps(session, 10)
    assert not falling.hand
    assert len(falling.hands[0]) == 0
    assert falling.points[0].mean(axis=0)[2] < held.points[0].mean(axis=0)[2] - 0.05
    session.rest()
    rest = steps(session, 1)
    assert rest.hand
    np.testing.assert_allclose(rest.points[0], session.bundle.topology.points, atol=0.02)


def test_settings_take_effect(session, steps):
    session.free()
    session.change(gravity=(0.0, 0.0, 0.0), drag_rate=20.0)
    still = steps(session, 40).points[0].mean(axis=0)
    np.testing.assert_allclose(steps(session, 10).points[0].mean(axis=0), still, atol=2e-3)
    session.change_one("wind", 0, 4.0)
    moment = steps(session, 30)
    assert moment.settings.wind == (4.0, 0.0)
    assert moment.points[0].mean(axis=0)[0] > still[0] + 0.01


def test_stiffness_of_a_part_and_the_ground(session, steps):
    session.free()
    session.change_one("stiffness", 1, 5.0)
    session.change(ground_height=0.2)
    moment = steps(session, 60)
    assert moment.settings.stiffness == (1.0, 5.0)
    assert moment.points[0][:, 2].min() > 0.19
    session.change(ground=False)
    assert steps(session, 30).points[0][:, 2].max() < 0.2


def test_time_stands_still_and_goes_on(session, steps):
    before = steps(session, 3)
    session.run(False)
    paused = steps(session, 5)
    assert not paused.running
    assert paused.frame == before.frame
    np.testing.assert_array_equal(paused.points[0], before.points[0])
    session.change(friction=1.0)
    assert steps(session, 1).settings.friction == 1.0
    session.run(True)
    assert steps(session, 2).frame == before.frame + 2


def test_the_edited_twin_has_the_settings_of_now(session, steps):
    assert session.edited() is session.bundle
    session.change(drag_rate=3.0)
    steps(session, 10)
    assert session.edited().parameters.globals["drag_rate"].value == 3.0


def test_with_and_without_an_effect_stand_side_by_side(plain_twin, steps, effect):
    blown = replace(plain_twin, effects=(effect("wind", drag_per_mass=5.0, x=4.0, y=0.0),))
    session = Session(blown, compare=True)
    assert [actor.name for actor in session.actors] == [WITHOUT, "with wind"]
    session.free()
    without, with_ = steps(session, 20).points
    alone = Session(plain_twin)
    alone.free()
    np.testing.assert_allclose(without, steps(alone, 20).points[0], atol=1e-5)
    assert with_.mean(axis=0)[0] > without.mean(axis=0)[0] + 0.05
    width = np.ptp(plain_twin.topology.points, axis=0).max()
    assert session.actors[1].shift[0] > width


def test_nothing_to_compare_is_refused(plain_twin):
    with pytest.raises(InputError, match="carries no effect"):
        Session(plain_twin, compare=True)


def test_an_effect_of_the_hand_is_idle_without_it(plain_twin, steps, effect):
    session = Session(replace(plain_twin, effects=(effect("grip_slip"),)))
    assert steps(session, 2).idle == ()
    session.free()
    assert steps(session, 2).idle == ("grip_slip",)


def test_what_leaves_the_numbers_starts_again_from_rest_and_says_why(session, steps):
    steps(session, 40)
    session.change(gravity=(0.0, 0.0, -1e30))
    moment = steps(session, 10)
    assert "back to rest" in moment.message
    assert moment.resets == 1
    assert moment.settings.gravity == (0.0, 0.0, -9.81)
    assert np.isfinite(steps(session, 5).points[0]).all()


def test_it_runs_in_real_time_and_hears_other_threads(session):
    stop, seen = threading.Event(), []
    thread = threading.Thread(target=session.keep_going, args=(stop, seen.append))
    thread.start()
    session.change(friction=0.7)
    started = time.monotonic()
    while session.moment.frame < 30 and time.monotonic() - started < 20:
        time.sleep(0.02)
    stop.set()
    thread.join(10)
    assert not thread.is_alive()
    assert session.moment.frame >= 30
    assert session.moment.frame <= 30 * (time.monotonic() - started + 1.0)
    assert session.moment.settings.friction == 0.7
    assert len(seen) >= 30


def test_another_material_takes_effect_and_what_the_user_set_stays(session, steps):
    session.change(friction=0.9, drag_rate=5.0)
    before = steps(session, 80)
    bundle = session.bundle
    entries = bundle.parameters.globals | {"restitution": Parameter(0.3, "1", "predicted")}
    stiff = replace(bundle.parameters, stiffness=5 * bundle.parameters.stiffness, globals=entries)
    session.remake(replace(bundle, parameters=stiff))
    after = steps(session, 1)
    assert after.resets == before.resets + 1
    assert (after.settings.friction, after.settings.restitution) == (0.9, 0.3)
    assert after.settings.stiffness == before.settings.stiffness
    np.testing.assert_array_equal(session.edited().parameters.stiffness, stiff.stiffness)
    assert session.edited().parameters.globals["friction"].source == "user"
    assert session.edited().parameters.globals["restitution"].source == "predicted"
    hanging = steps(session, 80).points[0]
    ends = bundle.topology.springs

    def strain(points):
        length = np.linalg.norm(points[ends[:, 1]] - points[ends[:, 0]], axis=1)
        return np.abs(length / bundle.topology.rest_length - 1.0).mean()

    assert strain(hanging) < 0.4 * strain(before.points[0])
