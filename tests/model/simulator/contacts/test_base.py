"""What every contact term must keep, asked of all of them."""

import pytest
import torch
from torch.autograd import gradcheck

from model.simulator.contacts import ALL_CONTACTS

every_contact = pytest.mark.parametrize("kind", ALL_CONTACTS, ids=lambda kind: kind.name)


@pytest.fixture
def cloud(rng):
    """Twelve unconnected points, above and below z = 0, many of them close, moving in all directions."""
    places = torch.from_numpy(rng.uniform(-0.05, 0.05, (12, 3)))
    return (
        places,
        torch.from_numpy(rng.normal(0, 1.0, (12, 3))),
        torch.from_numpy(rng.uniform(0.5, 2.0, (12, 1))),
    )


@pytest.fixture
def contact(rng, make, far_apart):
    def build(kind):
        term = make(kind, far_apart)
        values = {name: term.value(name) for name in kind.constants}
        if "height" in values:
            values["height"] = torch.zeros((), dtype=torch.float64)
        return term, values

    return build


@every_contact
def test_documents_reference_and_units(kind):
    assert "Reference:" in kind.__doc__
    for name, constant in kind.constants.items():
        assert f"{name}: " in kind.__doc__
        assert f"[{constant.unit}]" in kind.__doc__


@every_contact
def test_never_adds_energy_and_keeps_momentum_where_internal(kind, contact, cloud):
    places, speeds, mass = cloud
    term, values = contact(kind)
    after = term.resolve(places, speeds, mass, 1e-3, values)
    assert (after != speeds).any()
    assert (mass * after**2).sum() < (mass * speeds**2).sum()
    if kind.internal:
        torch.testing.assert_close((mass * after).sum(0), (mass * speeds).sum(0), rtol=1e-12, atol=1e-12)


@every_contact
def test_leaves_what_separates_alone(kind, contact, cloud):
    places, _, mass = cloud
    term, values = contact(kind)
    away = places - places.mean(0)  # every pair separates
    away[:, 2] += 1.0  # and all rise
    assert torch.equal(term.resolve(places, away, mass, 1e-3, values), away)


@every_contact
def test_gradients_are_right(kind, contact, cloud):
    places, speeds, mass = cloud
    term, values = contact(kind)
    names = [name for name in values if name != "height"]  # where the contact is decided, no gradient passes

    def resolve(places, speeds, mass, *numbers):
        return term.resolve(places, speeds, mass, 1e-3, {**values, **dict(zip(names, numbers, strict=True))})

    inputs = [places, speeds, mass, *(values[name] for name in names)]
    inputs = [value.detach().clone().requires_grad_() for value in inputs]
    assert gradcheck(resolve, inputs, eps=1e-7, atol=1e-5)


@every_contact
def test_batches_are_independent(kind, contact, cloud):
    places, speeds, mass = cloud
    term, values = contact(kind)
    together = term.resolve(
        torch.stack([places, places + 1]), torch.stack([speeds, -speeds]), mass, 1e-3, values
    )
    for number, (place, speed) in enumerate([(places, speeds), (places + 1, -speeds)]):
        torch.testing.assert_close(together[number], term.resolve(place, speed, mass, 1e-3, values))
