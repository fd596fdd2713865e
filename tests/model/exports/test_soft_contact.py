import numpy as np
import pytest

from model.exports.soft_contact import kept, soft_contact


@pytest.mark.parametrize("restitution", [0.05, 0.2, 0.5, 0.9, 1.0])
def test_the_share_of_the_speed_that_it_keeps_is_the_one_asked_for(restitution):
    _, damping = soft_contact(restitution, 1.0)
    assert kept(damping) == pytest.approx(restitution, abs=0.02)


def test_what_rests_sinks_by_little():
    step, place, speed = 1e-3, 0.0, 0.0
    stiffness, damping = soft_contact(0.2, step)
    for _ in range(500):
        push = max(-stiffness * place - damping * speed, 0.0) if place < 0 else 0.0
        speed += step * (push - 9.81)
        place += step * speed
    assert -20 * 9.81 * step**2 < place < 0
    assert abs(speed) < 1e-6


def test_time_scales():
    first, second = np.array(soft_contact(0.3, 1e-3)), np.array(soft_contact(0.3, 5e-4))
    np.testing.assert_allclose(second / first, [4, 2])
