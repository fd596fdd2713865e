"""Scales, bounds and shares of what is fitted."""

import pytest
import torch

from model.errors import InputError
from model.simulator.fitting.unknown import Gaussian, seek

STIFFNESS, DRAG, SPEED = "spring.stiffness", "drag.drag_rate", "state.velocities"


def test_scales_follow_what_a_parameter_may_be(chain):
    scene = chain()
    assert seek(scene, STIFFNESS).soft == 0.0
    assert seek(scene, DRAG).soft == pytest.approx(0.05)
    assert seek(scene, SPEED, start=0.0).soft is None
    assert seek(scene, SPEED, start=0.0, bounds=(-2.0, 2.0)).scale == pytest.approx(0.4)


@pytest.mark.parametrize("name", [STIFFNESS, DRAG, "gravity.gravity"])
def test_coordinates_lead_back_to_values(chain, name):
    unknown = seek(chain(), name)
    torch.testing.assert_close(unknown.values(unknown.coordinates(unknown.start)), unknown.start)
    low, high = unknown.limits()
    ends = unknown.values(torch.tensor([low, high], dtype=torch.float64))
    assert ends.tolist() == pytest.approx(unknown.bounds)


def test_a_gradient_does_not_vanish_at_zero(chain):
    unknown = seek(chain(drag=0.0), DRAG)
    z = unknown.coordinates(unknown.start).requires_grad_()
    value = unknown.apply(z)
    assert float(value.detach()) == pytest.approx(0.0, abs=1e-12)
    value.backward()
    assert float(z.grad) == pytest.approx(0.2)


def test_shared_values_start_from_the_mean_of_theirs(chain):
    scene = chain().with_values({STIFFNESS: torch.tensor([10.0, 40.0, 20.0, 5.0, 5.0, 5.0, 5.0])})
    unknown = seek(scene, STIFFNESS, share=torch.tensor([0, 0, 0, 1, 1, 1, 1]))
    assert unknown.start.tolist() == pytest.approx([20.0, 5.0])
    applied = unknown.apply(unknown.coordinates(unknown.start))
    assert applied.tolist() == pytest.approx([20.0] * 3 + [5.0] * 4)


def test_factors_keep_what_there_is_in_proportion(chain):
    stiffness = torch.tensor([10.0, 40.0, 20.0, 5.0, 5.0, 5.0, 5.0])
    scene = chain().with_values({STIFFNESS: stiffness})
    unknown = seek(scene, STIFFNESS, relative=True, share=torch.zeros(7, dtype=torch.long))
    assert unknown.bounds == (0.01, 100.0)
    torch.testing.assert_close(unknown.apply(torch.log(torch.tensor([3.0]).double())), 3 * stiffness.double())


def test_a_prior_counts_standard_deviations(chain):
    scene = chain()
    logarithmic = seek(scene, STIFFNESS, start=60.0, prior=Gaussian(60.0, 0.5))
    z = logarithmic.coordinates(torch.tensor(60.0 * 2.718281828459045))
    assert float(logarithmic.slack(z)) == pytest.approx(2.0)
    linear = seek(scene, SPEED, start=0.0, prior=Gaussian(1.0, 0.5))
    assert float(linear.slack(linear.coordinates(torch.tensor(2.0)))) == pytest.approx(2.0)
    soft = seek(scene, DRAG, start=0.5, prior=Gaussian(0.5, 0.1))
    assert float(soft.slack(soft.coordinates(torch.tensor(0.505)))) == pytest.approx(0.1, rel=0.01)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"bounds": (3.0, 1.0)}, "bounds of spring.stiffness are 3.0 … 1.0"),
        ({"bounds": (-1.0, 1.0)}, "bounds of spring.stiffness are -1.0"),
        ({"start": float("nan")}, "starts from a value that is not finite"),
        ({"share": torch.tensor([0, 1]), "start": torch.ones(3)}, "3 values, but 2 are shared out"),
    ],
)
def test_what_cannot_be_is_refused(chain, options, said):
    with pytest.raises(InputError, match=said):
        seek(chain(), STIFFNESS, **options)
