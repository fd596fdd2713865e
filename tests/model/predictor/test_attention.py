import pytest
import torch

from model.predictor.attention import AttentionPool, Mixer


@pytest.fixture
def pool():
    torch.manual_seed(0)
    return AttentionPool(8, 2).double()


def test_pooling_is_softmax_attention_over_each_group(pool):
    rows, query = torch.randn(7, 8, dtype=torch.float64), torch.randn(3, 8, dtype=torch.float64)
    group = torch.tensor([0, 2, 0, 2, 2, 0, 0])
    found = pool(rows, query, group)
    for one in (0, 2):
        own = rows[group == one]
        keys, values = pool.key(own), pool.value(own)
        expected = []
        for half in (slice(0, 4), slice(4, 8)):
            weight = torch.softmax(keys[:, half] @ query[one, half] / 2.0, dim=0)
            expected.append(weight @ values[:, half])
        torch.testing.assert_close(found[one], torch.cat(expected))
    assert (found[1] == 0.0).all()  # nobody's group


def test_large_scores_do_not_overflow(pool):
    rows = 1e5 * torch.randn(5, 8, dtype=torch.float64)
    found = pool(rows, 1e5 * torch.ones(1, 8, dtype=torch.float64), torch.zeros(5, dtype=torch.long))
    assert torch.isfinite(found).all()


def test_gradients_are_derivatives(pool):
    rows = torch.randn(4, 8, dtype=torch.float64, requires_grad=True)
    query = torch.randn(2, 8, dtype=torch.float64, requires_grad=True)
    group = torch.tensor([0, 1, 1, 0])
    assert torch.autograd.gradcheck(lambda r, q: pool(r, q, group), (rows, query))


def test_cases_do_not_see_each_other_and_parts_have_no_order():
    torch.manual_seed(0)
    mixer = Mixer(8, 2, 2, 0.0).double().eval()
    scene, part = torch.randn(2, 8, dtype=torch.float64), torch.randn(4, 8, dtype=torch.float64)
    where = torch.tensor([0, 1, 1, 1])
    first, second = mixer(scene, part, where)
    alone, own = mixer(scene[1:], part[1:], torch.zeros(3, dtype=torch.long))
    torch.testing.assert_close(first[1:], alone)
    torch.testing.assert_close(second[1:], own)
    turned, others = mixer(scene, part[[0, 3, 1, 2]], where)
    torch.testing.assert_close(turned, first)
    torch.testing.assert_close(others, second[[0, 3, 1, 2]])
    changed = part.clone()
    changed[3] += torch.linspace(-1, 1, 8)
    apart, whole = mixer(scene, changed, where)
    assert (apart[1] - first[1]).abs().max() > 1e-3  # but parts of one case do
    torch.testing.assert_close(whole[0], second[0])
