import numpy as np
import pytest
import torch
from scipy.integrate import quad
from scipy.stats import lognorm

from model.predictor.losses import chamfer_loss, covered, log_normal_divergence, surprise, track_loss


@pytest.mark.parametrize(
    ("mean", "spread", "prior_mean", "prior_spread"),
    [(0.0, 1.0, 0.0, 1.0), (0.5, 0.3, -0.2, 0.8), (9.0, 0.9, 8.0, 0.4)],
)
def test_the_divergence_is_that_of_the_densities_of_log_normals(mean, spread, prior_mean, prior_spread):
    ours = lognorm(s=spread, scale=np.exp(mean))
    prior = lognorm(s=prior_spread, scale=np.exp(prior_mean))

    def integrand(z):  # over the logarithm of the variable, where the mass is
        x = np.exp(mean + spread * z)
        return ours.pdf(x) * (ours.logpdf(x) - prior.logpdf(x)) * x * spread

    expected = quad(integrand, -12.0, 12.0, epsabs=1e-12)[0]
    values = [torch.tensor([v], dtype=torch.float64) for v in (mean, spread, prior_mean, prior_spread)]
    assert float(log_normal_divergence(*values)) == pytest.approx(expected, abs=1e-9)


def test_the_divergence_has_its_least_value_at_the_prior():
    mean = torch.tensor([2.0], dtype=torch.float64, requires_grad=True)
    spread = torch.tensor([0.7], dtype=torch.float64, requires_grad=True)
    value = log_normal_divergence(mean, spread, mean.detach(), spread.detach())
    value.sum().backward()
    assert float(value.detach()) == pytest.approx(0.0, abs=1e-12)
    assert float(mean.grad) == pytest.approx(0.0, abs=1e-12)
    assert float(spread.grad) == pytest.approx(0.0, abs=1e-12)


def test_surprise_is_the_negative_log_density_and_skips_what_is_not_known():
    mean, spread = torch.tensor([1.0, 5.0]), torch.tensor([0.5, 0.1])
    truth = torch.tensor([1.8, torch.nan])
    expected = -torch.distributions.Normal(1.0, 0.5).log_prob(torch.tensor(1.8))
    assert float(surprise(mean, spread, truth)) == pytest.approx(float(expected), rel=1e-6)
    assert float(surprise(mean, spread, torch.full((2,), torch.nan))) == 0.0


def test_surprise_is_least_at_the_true_spread():
    generator = torch.Generator().manual_seed(0)
    truth = 0.4 * torch.randn(20_000, generator=generator)
    found = {
        s: float(surprise(torch.zeros(20_000), torch.full((20_000,), s), truth)) for s in (0.3, 0.4, 0.5)
    }
    assert min(found, key=found.__getitem__) == 0.4


def test_a_ninety_percent_interval_covers_ninety_percent():
    generator = torch.Generator().manual_seed(1)
    truth = 2.0 * torch.randn(20_000, generator=generator)
    inside = covered(torch.zeros(20_000), torch.full((20_000,), 2.0), truth)
    assert float(inside.float().mean()) == pytest.approx(0.9, abs=0.01)


def cloud(frames=12, points=9):
    generator = torch.Generator().manual_seed(2)
    return torch.rand(frames, points, 3, generator=generator)


def test_track_loss_counts_seen_points_alone():
    seen, predicted = cloud(), cloud()
    seen[3, 4] = torch.nan
    predicted[3, 4] += 100.0
    assert float(track_loss(predicted, seen, 0.1)) == 0.0
    predicted[2, 1, 0] += 0.1
    points = 12 * 9 - 1
    assert float(track_loss(predicted, seen, 0.1)) == pytest.approx((2**0.5 - 1) / points, rel=1e-4)


def test_track_loss_grows_linearly_far_away():
    seen = cloud()
    far = [float(track_loss(seen + torch.tensor([d, 0.0, 0.0]), seen, 0.01)) for d in (1.0, 2.0)]
    assert far[1] / far[0] == pytest.approx(2.0, rel=0.02)


def test_a_single_camera_does_not_blame_what_it_cannot_see():
    seen, eye = cloud(), torch.tensor([0.5, -5.0, 0.5])
    along = torch.nn.functional.normalize(seen - eye, dim=-1)
    assert float(track_loss(seen + 0.3 * along, seen, 0.05, eye)) == pytest.approx(0.0, abs=1e-5)
    assert float(track_loss(seen + 0.3 * along, seen, 0.05)) > 1.0
    assert float(chamfer_loss(seen + 0.3 * along, seen, 0.05, eye)) < float(
        chamfer_loss(seen + 0.3 * along, seen, 0.05)
    )


def test_chamfer_does_not_ask_which_point_is_which():
    seen = cloud()
    assert float(chamfer_loss(seen.flip(1), seen, 0.1)) == pytest.approx(0.0, abs=1e-6)
    assert float(track_loss(seen.flip(1), seen, 0.1)) > 0.5


def test_chamfer_is_one_way_and_skips_what_is_not_seen():
    seen = cloud()
    extra = torch.cat([seen, seen[:, :3] + 10.0], dim=1)
    assert float(chamfer_loss(extra, seen, 0.1)) == pytest.approx(0.0, abs=1e-6)
    seen[:, 2:] = torch.nan
    assert float(chamfer_loss(cloud()[:, :2], seen, 0.1)) == pytest.approx(0.0, abs=1e-6)


def test_chamfer_is_the_mean_over_seen_points_of_the_penalty_of_the_nearest():
    seen, predicted = cloud(), cloud() + 0.05
    expected = []
    for frame, goal in zip(predicted.numpy(), seen.numpy(), strict=True):
        distance = np.linalg.norm(goal[:, None] - frame[None], axis=-1).min(axis=1)
        expected.append(np.sqrt(1.0 + (distance / 0.1) ** 2) - 1.0)
    assert float(chamfer_loss(predicted, seen, 0.1)) == pytest.approx(float(np.mean(expected)), rel=1e-4)


def test_nothing_seen_means_no_loss_and_no_gradient():
    predicted = cloud().requires_grad_()
    seen = torch.full((12, 9, 3), torch.nan)
    total = track_loss(predicted, seen, 0.1) + chamfer_loss(predicted, seen, 0.1)
    total.backward()
    assert float(total.detach()) == 0.0
    assert float(predicted.grad.abs().max()) == 0.0
