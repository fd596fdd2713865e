import pytest

from model.playground.pulse import BEHIND, Pulse


def test_frames_that_are_early_wait_and_late_ones_do_not():
    pulse = Pulse(0.1)
    assert pulse.wait(5.0) == 0.0
    pulse.beat(5.0)
    assert pulse.wait(5.04) == pytest.approx(0.06)
    assert pulse.wait(5.5) == 0.0


def test_what_is_far_behind_is_given_up():
    pulse = Pulse(0.1)
    pulse.beat(0.0)
    pulse.beat(10.0)
    late = 0.0
    while pulse.wait(10.0) == 0.0:
        pulse.beat(10.0)
        late += 0.1
    assert late <= BEHIND + 0.1


@pytest.mark.parametrize(("seconds", "speed"), [(0.1, 1.0), (0.2, 0.5)])
def test_the_speed_is_simulated_over_real_time(seconds, speed):
    pulse = Pulse(0.1)
    for frame in range(20):
        pulse.beat(frame * seconds)
    assert pulse.speed == pytest.approx(speed)


def test_after_a_pause_the_speed_is_not_known():
    pulse = Pulse(0.1)
    for frame in range(5):
        pulse.beat(frame * 0.1)
    pulse.pause()
    assert pulse.speed is None
    assert pulse.wait(7.0) == 0.0
