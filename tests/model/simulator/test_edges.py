import pytest
import torch
from torch.autograd import gradcheck, gradgradcheck

from model.simulator.edges import Edges


@pytest.fixture
def edges():
    return Edges(
        torch.tensor([[0, 1], [3, 0], [1, 2]]),
        torch.tensor([[1, 2], [0, 2]]),
        point_count=4,
        controller_count=2,
    )


def test_differences_and_totals_by_hand(edges):
    nodes = torch.arange(6.0)[:, None] ** 2 * torch.tensor([1.0, 10.0, 100.0])
    # 0→1, 3→0, 1→2, then from points to controllers: 2→4+1, 2→4+0
    assert edges.difference(nodes)[:, 0].tolist() == [1 - 0, 0 - 9, 4 - 1, 25 - 4, 16 - 4]
    flows = torch.tensor([1.0, 2.0, 4.0, 8.0, 16.0])[:, None] * torch.ones(3)
    assert edges.total(flows)[:, 0].tolist() == [-1 + 2, 1 - 4, 4 - 8 - 16, -2, 16, 8]


def test_the_two_are_adjoint_to_second_order(edges):
    nodes = torch.randn(
        6, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0)
    ).requires_grad_()
    assert gradcheck(lambda x: edges.difference(x) ** 3, nodes)
    assert gradgradcheck(lambda x: edges.difference(x) ** 3, nodes)
    flows = torch.randn(
        5, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1)
    ).requires_grad_()
    assert gradcheck(lambda f: edges.total(f) ** 3, flows)
    assert gradgradcheck(lambda f: edges.total(f) ** 3, flows)


def test_batches(edges):
    flows = torch.randn(2, 3, 5, 3, generator=torch.Generator().manual_seed(2))
    torch.testing.assert_close(edges.total(flows)[1, 2], edges.total(flows[1, 2]))
    nodes = torch.randn(2, 3, 6, 3, generator=torch.Generator().manual_seed(3))
    torch.testing.assert_close(edges.difference(nodes)[1, 2], edges.difference(nodes[1, 2]))


def test_no_edges():
    none = Edges(torch.zeros((0, 2), dtype=torch.long), torch.zeros((0, 2), dtype=torch.long), 3, 0)
    assert none.total(torch.zeros(0, 3)).tolist() == [[0.0] * 3] * 3
