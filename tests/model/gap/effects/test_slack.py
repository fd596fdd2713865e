"""Cloth that goes slack instead of being pressed together does so with every effect."""

import pytest
import torch

from model.gap.effects import ALL_EFFECTS
from model.gap.wrinkling import SLACKNESS, wrinkling
from model.simulator.forces.base import AxialForce
from model.simulator.system import Anchors, State

STRAIN = 0.1
MATERIAL = [
    kind() for kind in ALL_EFFECTS if any(issubclass(law, AxialForce) and law.internal for law in kind.terms)
]


STIFF = [effect for effect in MATERIAL if effect.name != "tension_only"]
"""What makes slack itself cannot act on what is."""


def tensions(world, strain):
    """Of springs that are all strained alike, and remember nothing yet [N]."""
    points, still = world.system.points, torch.zeros_like(world.system.points)
    held = torch.zeros((world.system.controller_count, 3), dtype=points.dtype)
    dynamics = world.simulator.dynamics()
    motion = dynamics.motion(State((1.0 + strain) * points, still), Anchors(held, held))
    material = [
        (term, values)
        for term, values in dynamics.forces
        if isinstance(term, AxialForce) and term.internal and term.where == "springs"
    ]
    force = sum(term.edge_force(motion, values) for term, values in material)
    return (force * motion.over(motion.axis, "springs", dim=-2)).sum(-1)


@pytest.mark.parametrize("effect", STIFF, ids=lambda effect: effect.name)
def test_what_is_slack_stays_slack(block, effect):
    """Whatever the material is like: it bears no more of compression than of tension, times its share."""
    cloth = block.with_force(wrinkling(block, SLACKNESS))
    values = {name: torch.tensor(q.start, dtype=torch.float64) for name, q in effect.quantities.items()}
    world = effect.apply(cloth, values)
    pulled, pressed = tensions(world, STRAIN), -tensions(world, -STRAIN)
    most = torch.maximum(pulled, tensions(cloth, STRAIN))  # damage may take of tension what it leaves here
    assert bool((pressed <= 1.001 * (1.0 - SLACKNESS) * most).all())
    assert float(pressed.min()) > 0.0


def test_a_solid_bears_compression(block):
    """Where nothing goes slack these laws press as they pull."""
    for effect in MATERIAL:
        if effect.name in ("strain_stiffening", "anisotropy", "viscoelasticity"):
            values = {
                name: torch.tensor(q.start, dtype=torch.float64) for name, q in effect.quantities.items()
            }
            world = effect.apply(block, values)
            torch.testing.assert_close(tensions(world, -STRAIN), -tensions(world, STRAIN))
