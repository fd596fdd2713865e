import torch

from model.evaluation.baselines.message_passing import MessagePassing

PAIRS = torch.tensor([[0, 1], [1, 2], [2, 3]])
"""A chain: 0 is heard by 1, and so on."""


def _network(passes):
    network = MessagePassing(2, 3, width=16, passes=passes, seed=1)
    for layer in network.modules():  # the last layer begins at zero, which would hide everything
        if isinstance(layer, torch.nn.Linear):
            torch.nn.init.normal_(layer.weight, generator=torch.Generator().manual_seed(2))
    return network


def test_it_begins_with_nothing_to_say():
    network = MessagePassing(2, 3, width=16, passes=2, seed=1)
    assert torch.equal(network(torch.ones(5, 4, 2), torch.ones(5, 3, 3), PAIRS), torch.zeros(5, 4, 3))


def test_news_travel_one_pair_per_pass():
    for passes in (1, 2, 3):
        network, nodes, edges = _network(passes), torch.ones(1, 4, 2), torch.ones(1, 3, 3)
        before = network(nodes, edges, PAIRS)
        nodes[0, 0] = 3.0
        changed = (network(nodes, edges, PAIRS) - before).abs().amax(-1)[0] > 1e-6
        assert changed.tolist() == [number <= passes for number in range(4)]


def test_pairs_may_come_in_any_order_and_scenes_do_not_mix():
    network = _network(2)
    random = torch.Generator().manual_seed(3)
    nodes = torch.rand(2, 4, 2, generator=random)
    edges = torch.rand(2, 3, 3, generator=random)
    made = network(nodes, edges, PAIRS)
    order = torch.tensor([2, 0, 1])
    assert torch.allclose(network(nodes, edges[:, order], PAIRS[order]), made, atol=1e-5)
    assert torch.allclose(network(nodes[1:], edges[1:], PAIRS), made[1:], atol=1e-5)


def test_one_seed_is_one_start():
    first, second = (MessagePassing(2, 3, width=8, passes=1, seed=4) for _ in range(2))
    for a, b in zip(first.parameters(), second.parameters(), strict=True):
        assert torch.equal(a, b)
