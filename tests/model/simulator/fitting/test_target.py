"""What is compared, and what is not."""

import numpy as np
import pytest
import torch

from model.errors import InputError
from model.simulator.fitting.target import Target

NAN = float("nan")


@pytest.fixture
def seen():
    points = torch.zeros(3, 2, 3)
    points[1, 1] = NAN
    points[2, 0, 2] = NAN
    return points


def test_only_what_is_seen_counts(seen):
    target = Target(seen, noise=0.5)
    assert target.count() == 12
    assert target.count(2) == 9
    residuals = target.residuals(torch.full((3, 2, 3), 1.0))
    assert residuals[1, 1].tolist() == [0.0, 0.0, 0.0]
    assert residuals[2, 0].tolist() == [0.0, 0.0, 0.0]
    assert residuals[0, 0].tolist() == [-2.0, -2.0, -2.0]
    assert target.error(torch.full((3, 2, 3), 1.0)) == pytest.approx(3**0.5)


def test_no_nan_reaches_a_gradient(seen):
    points = torch.zeros(3, 2, 3, requires_grad=True)
    Target(seen).residuals(points + 1.0).square().sum().backward()
    assert bool(torch.isfinite(points.grad).all())
    assert float(points.grad[1, 1].abs().sum()) == 0.0


def test_observed_points_hang_on_mass_points(seen):
    index, weight = torch.tensor([[0, 1], [2, 2]]), torch.tensor([[0.25, 0.75], [1.0, 0.0]])
    mass_points = torch.arange(9.0).reshape(3, 3).expand(3, 3, 3)
    there = Target(seen, index, weight).where(mass_points)
    assert there[0].tolist() == [[2.25, 3.25, 4.25], [6.0, 7.0, 8.0]]
    assert Target(seen, index).where(mass_points)[0, 0].tolist() == [1.5, 2.5, 3.5]


def test_importance_weighs_squares(seen):
    importance = torch.tensor([[4.0, 1.0], [0.0, 1.0], [1.0, 1.0]])
    target = Target(seen, importance=importance, noise=1.0)
    squares = target.residuals(torch.ones(3, 2, 3)).square().sum(-1)
    assert squares.tolist() == [[12.0, 3.0], [0.0, 0.0], [0.0, 3.0]]
    assert target.count() == 9


def test_parameter_sets_side_by_side(seen):
    target = Target(seen)
    points = torch.rand(3, 5, 2, 3)
    both = target.residuals(points)
    assert both.shape == (3, 5, 2, 3)
    torch.testing.assert_close(both[:, 4], target.residuals(points[:, 4]))


def test_a_split_shares_the_frames_out(seen):
    train, held = Target(seen).split(np.array([False, False, True]))
    assert train.count() + held.count() == 12
    assert train.count(3) == 9
    assert np.isnan(train.error(torch.zeros(3, 2, 3)[:0]))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"noise": 0.0}, "noise of the target is 0.0"),
        ({"index": torch.zeros(3, 1, dtype=torch.long)}, "3 bindings for 2 observed points"),
    ],
)
def test_what_cannot_be_is_refused(seen, options, said):
    with pytest.raises(InputError, match=said):
        Target(seen, **options)
    with pytest.raises(InputError, match="no point that is seen"):
        Target(torch.full((2, 2, 3), NAN))
