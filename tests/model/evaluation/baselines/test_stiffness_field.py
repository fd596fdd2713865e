import torch

from model.evaluation.baselines.stiffness_field import StiffnessField, unit_cube

PLACES = 2.0 * torch.rand((50, 3), generator=torch.Generator().manual_seed(1)) - 1.0


def _trained(field, wanted, steps=150):
    optimiser = torch.optim.Adam(field.parameters(), lr=0.01)
    for _ in range(steps):
        optimiser.zero_grad()
        (field(PLACES) - wanted).square().mean().backward()
        optimiser.step()
    return field


def test_it_begins_at_nothing_and_learns_a_function_of_place():
    field = StiffnessField(-4.0, 2.0)
    assert torch.equal(field(PLACES), torch.zeros(50))
    wanted = torch.where(PLACES[:, 0] > 0, 1.0, -1.5)
    assert (_trained(field, wanted)(PLACES) - wanted).abs().mean() < 0.15


def test_it_keeps_its_limits_and_its_slope_there():
    field = _trained(StiffnessField(-4.0, 0.5), torch.full((50,), 30.0))
    value = field(PLACES)
    assert 0.4 < value.max() < 0.5
    value.sum().backward()
    assert all(p.grad.abs().max() > 0 for p in field.parameters())


def test_it_sees_every_coordinate():
    field = StiffnessField(-4.0, 2.0)
    wanted = PLACES.sum(1) / 3
    _trained(field, wanted)
    places = PLACES.clone().requires_grad_()
    field(places).sum().backward()
    assert (places.grad.abs().mean(0) > 0.05).all()


def test_one_seed_is_one_start_whatever_torch_has_drawn():
    fields = []
    for global_seed in (0, 1):
        torch.manual_seed(global_seed)
        fields.append(StiffnessField(-1.0, 1.0, seed=5))
    pairs = zip(fields[0].parameters(), fields[1].parameters(), strict=True)
    assert all(torch.equal(a, b) for a, b in pairs)
    assert not torch.equal(StiffnessField(-1.0, 1.0, seed=6).planes, fields[0].planes)


def test_the_cube_holds_the_body_without_bending_it():
    body = torch.tensor([[1.0, 2.0, 3.0], [5.0, 3.0, 3.0]])
    assert torch.allclose(unit_cube(body, body), torch.tensor([[-1.0, -0.25, 0.0], [1.0, 0.25, 0.0]]))
