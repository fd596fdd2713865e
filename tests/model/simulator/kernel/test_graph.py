"""A traced law says what the law says."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from model.simulator.kernel.expression import Untraceable
from model.simulator.kernel.graph import Graph, evaluate, ordered

UNARY = (torch.exp, torch.tanh, torch.sin, torch.cos, torch.square, torch.abs, torch.relu)
SAFE = (lambda x: torch.sqrt(x * x + 0.3), lambda x: torch.log(1.0 + x * x), lambda x: 1.0 / (2.0 + x * x))
BINARY = (
    lambda a, b: a + b,
    lambda a, b: a - b,
    lambda a, b: a * b,
    lambda a, b: a / (1.5 + b**2),
    torch.maximum,
    torch.minimum,
    lambda a, b: torch.where(a < b, a * b, 3.0 - b),
    lambda a, b: torch.where((a >= 0.2) & ~(b > 1.0), a**3, (b * b + 0.5) ** -2),
    lambda a, b: (a * a + 0.5) ** (b * 0.5),
    lambda a, b: (a > b) * a,
    lambda a, b: a.clamp(min=-0.5, max=0.5) * b.detach(),
)


@st.composite
def programs(draw):
    """A law as a list of steps, each on the results so far."""
    steps = []
    for known in range(3, 3 + draw(st.integers(1, 8))):
        operands = st.integers(0, known - 1)
        if draw(st.booleans()):
            steps.append((draw(st.sampled_from(UNARY + SAFE)), (draw(operands),)))
        else:
            steps.append((draw(st.sampled_from(BINARY)), (draw(operands), draw(operands))))
    return steps


def run(steps, start):
    values = list(start)
    for function, operands in steps:
        result = function(*(values[i] for i in operands))
        values.append(torch.tanh(result))  # keeps chains of exponentials within the numbers
    return values[-1]


@settings(max_examples=150)
@given(programs(), st.tuples(*[st.floats(-2, 2).filter(lambda x: abs(x) > 0.05)] * 3))
def test_values_are_those_of_torch(steps, point):
    graph = Graph()
    traced = run(steps, [graph.symbol(name) for name in "xyz"])
    expected = run(steps, [torch.tensor(value, dtype=torch.float64) for value in point])
    found = evaluate([traced], dict(zip("xyz", point, strict=True)))[0]
    assert math.isclose(found, float(expected), rel_tol=1e-11, abs_tol=1e-11)


def test_equal_subexpressions_are_one_node():
    graph = Graph()
    x, y = graph.symbol("x"), graph.symbol("y")
    assert x * y + 1.0 is y * x + 1.0
    assert [node.operation for node in ordered([(x * y) ** 2 + x * y])].count("mul") == 2


def test_what_needs_no_operation_costs_none():
    graph = Graph()
    x = graph.symbol("x")
    assert x + 0.0 is x
    assert 1.0 * x is x
    assert 0.0 - (0.0 - x) is x
    assert (x - x).value == 0.0
    assert (0.0 * torch.exp(x)).value == 0.0
    assert torch.where(graph.constant(2.0) > 1.0, x, -x) is x


@pytest.mark.parametrize(
    ("law", "complaint"),
    [
        (lambda x: torch.erfinv(x), "torch.erfinv has no symbol"),
        (lambda x: x if x > 0 else -x, "use torch.where"),
        (lambda x: x.shape[0], "has no 'shape'"),
        (lambda x: torch.ones(3) * x, "computes with a Tensor"),
        (lambda x: torch.sub(x, 1.0, alpha=2.0), "no symbol"),
    ],
)
def test_what_has_no_symbol_is_refused_and_named(law, complaint):
    with pytest.raises(Untraceable, match=complaint):
        law(Graph().symbol("x"))
