"""Reverse derivatives of traced laws are those of torch."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from model.simulator.kernel.differentiate import pullback
from model.simulator.kernel.graph import Graph, evaluate

LAWS = {
    "rational": lambda x, y: (x * y - 3.0) / (x * x + y + 4.0),
    "powers": lambda x, y: x**3 - 2.0 * y**-2 + (x * x + 1.0) ** 0.5 + (y * y + 1.0) ** (0.3 * x) + 2.0**x,
    "functions": lambda x, y: (
        torch.exp(-x * y) + torch.log(x * x + 1.0) * torch.tanh(y) + torch.sqrt(y * y + 0.1)
    ),
    "waves": lambda x, y: torch.sin(x * y) * torch.cos(x - y),
    "kinks": lambda x, y: torch.maximum(x, y) * torch.abs(x) + torch.minimum(x * x, y) + torch.relu(y),
    "branches": lambda x, y: torch.where(x < y, x * y, torch.where(x > 1.0, y**2, x / 3.0)),
    "clamps": lambda x, y: x.clamp(min=-0.3, max=0.4) * y + torch.clamp(y, max=0.7) ** 2,
    "detached": lambda x, y: x.detach() * y + torch.reciprocal(y * y + 1.0),
    "shared": lambda x, y: (lambda s: s * s + torch.exp(-s) * s)(x * y + x),
}
NUMBERS = st.floats(-2, 2).filter(lambda x: abs(x) > 0.05)


@pytest.mark.parametrize("name", LAWS)
@settings(max_examples=25)
@given(x=NUMBERS, y=NUMBERS)
def test_derivatives_are_those_of_autograd(name, x, y):
    law = LAWS[name]
    leaves = [torch.tensor(value, dtype=torch.float64, requires_grad=True) for value in (x, y)]
    expected = torch.autograd.grad(3.0 * law(*leaves), leaves, allow_unused=True)
    graph = Graph()
    symbols = [graph.symbol("x"), graph.symbol("y")]
    back = pullback(graph, [law(*symbols)], [graph.constant(3.0)], symbols)
    for found, value in zip(evaluate(back, {"x": x, "y": y}), expected, strict=True):
        assert found == pytest.approx(0.0 if value is None else float(value), rel=1e-10, abs=1e-12)


def test_several_outputs_add_up():
    graph = Graph()
    x, a, b = graph.symbol("x"), graph.symbol("a"), graph.symbol("b")
    (back,) = pullback(graph, [x * x, torch.exp(x)], [a, b], [x])
    assert evaluate([back], {"x": 0.0, "a": 5.0, "b": 7.0}) == [7.0]
    assert evaluate([back], {"x": 2.0, "a": 1.0, "b": 0.0}) == [4.0]


def test_what_does_not_depend_has_no_derivative():
    graph = Graph()
    x, y = graph.symbol("x"), graph.symbol("y")
    (back,) = pullback(graph, [torch.exp(y)], [graph.constant(1.0)], [x])
    assert back.value == 0.0
