"""The flexible force is silent at first, keeps momentum, and does not know where the body is."""

from dataclasses import replace

import pytest
import torch

from model.gap.residual_force import RESIDUAL, LearnedTension, ResidualBending, ResidualMaterial

IN_A_SOLID = [kind for kind in RESIDUAL if kind is not ResidualBending]


def weights(kind, value):
    return {name: torch.tensor(value, dtype=torch.float64) for name in kind.quantities}


@pytest.mark.parametrize("kind", IN_A_SOLID, ids=lambda kind: kind.name)
def test_without_weights_nothing_moves_otherwise(kind, block):
    effect = kind()
    assert effect.unable(block) is None
    short = replace(block, times=block.times[:3], controls=block.controls[:3])
    short = replace(short, simulator=short.simulator.with_backend("torch"))
    with torch.no_grad():
        before = short.rollout(substeps=40).points
        same = effect.apply(short, weights(kind, 0.0)).rollout(substeps=40).points
        other = effect.apply(short, weights(kind, 0.3)).rollout(substeps=40).points
    torch.testing.assert_close(same, before, rtol=0, atol=1e-12)
    assert not torch.allclose(other, before, rtol=0, atol=1e-9)


def test_springs_pull_at_both_ends_alike_wherever_the_body_is(block):
    world = ResidualMaterial().apply(block, weights(ResidualMaterial, 0.3))
    term = world.simulator.force(LearnedTension.name)
    generator = torch.Generator().manual_seed(0)
    shaken = 5e-3 * torch.randn(block.system.points.shape, generator=generator, dtype=torch.float64)
    turn = torch.tensor([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]], dtype=torch.float64)
    rest = block.simulator.rest_state()
    here = replace(rest, positions=rest.positions + shaken, velocities=10.0 * shaken)
    there = replace(here, positions=here.positions @ turn.T + 1.0, velocities=here.velocities @ turn.T)
    dynamics = world.simulator.dynamics()
    values = term.values(rest.positions)
    anchors = world.simulator._held()
    found, turned = (term.force(dynamics.motion(state, anchors), values) for state in (here, there))
    assert found.abs().max() > 1e-3
    torch.testing.assert_close(found.sum(0), torch.zeros(3, dtype=torch.float64), atol=1e-12, rtol=0)
    torch.testing.assert_close(turned, found @ turn.T)


def test_a_solid_needs_no_rows_that_bend(block, loose):
    assert ResidualBending().unable(block) == "a solid bends by its springs"
    assert ResidualBending().unable(loose) == "no three points are in a row"
