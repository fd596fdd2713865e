"""Cloth bears hardly any compression, and how it bends and comes to rest is for its fit to find."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from model.gap.bodies.body import body_of
from model.gap.effects import Damage, Plasticity
from model.gap.effects.tension_only import TensionOnly
from model.gap.hypothesis import Hypothesis
from model.gap.plain import PlainTwin
from model.gap.wrinkling import SLACKNESS
from model.simulator.dynamics import Dynamics
from model.simulator.system import State, System
from model.types import Observation

ALONG = ("spring", "wrinkling")


def plain_of(still: Observation) -> Hypothesis:
    return Hypothesis(PlainTwin.of(body_of(still), still))


def starts(plain: Hypothesis) -> dict[str, float]:
    return {name: quantity.start for name, quantity in plain.quantities.items()}


def held(points: np.ndarray) -> Observation:
    """What lies still in four frames, its first point in a hand."""
    return Observation(np.arange(4) / 30.0, np.repeat(points[None], 4, 0), np.repeat(points[None, :1], 4, 0))


def along_springs(world, scale: float) -> float:
    """Size of the forces along springs [N] of a world that is so many times as large as at rest."""
    simulator, here = world.simulator, world.system
    rest = here.points[here.springs[:, 1]] - here.points[here.springs[:, 0]]
    system = System(points=here.points, mass=1.0, springs=here.springs, rest_length=rest.norm(dim=-1))
    terms = [simulator.force(name) for name in ALONG if name in simulator.forces]
    dynamics = Dynamics(system, terms, [])
    places = scale * system.points
    motion = dynamics.motion(State(places, torch.zeros_like(places)), None)
    forces = [term.force(motion, values) for term, values in dynamics.forces]
    return float(torch.stack(forces).sum(0).norm())


def test_cloth_bears_a_little_compression_and_all_tension(hung):
    world = plain_of(hung).at(starts(plain_of(hung)))
    pulled, pressed = (along_springs(world, scale) for scale in (1.05, 0.95))
    assert pressed == pytest.approx((1.0 - SLACKNESS) * pulled, rel=1e-3)


def test_ropes_and_solids_do_not_wrinkle(block):
    solid = block.simulator.system.points.numpy()
    rope = np.stack([np.linspace(0, 0.5, 20), np.zeros(20), np.zeros(20)], -1)
    for places, shape in ((solid, "solid"), (rope, "rope")):
        still = held(places.astype(np.float32))
        one = Hypothesis(PlainTwin.of(body_of(still, shape), still))
        assert "wrinkling" not in one.at(starts(one)).simulator.forces
        assert not {"bending", "bending_decay"} & one.quantities.keys()


def test_slack_springs_are_nothing_that_cloth_may_lack(hung):
    plain = plain_of(hung)
    assert "already" in TensionOnly().unable(plain.at(starts(plain)))
    bare = replace(plain, twin=replace(plain.twin, matter=replace(plain.twin.matter, slackness=0.0)))
    assert TensionOnly().unable(bare.at(starts(bare))) is None


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        (Damage(), {"softening": 0.9, "damage_strain": 0.01, "pseudo_elasticity": 0.0}),
        (Plasticity(), {"flow_rate": 100.0, "yield_strain": 0.005, "hardening": 0.0}),
    ],
)
def test_what_a_cloth_has_lost_it_does_not_lose_twice(hung, effect, values):
    """Springs that were stretched and are pressed push back, and by no more than slack ones do."""
    plain = plain_of(hung)
    world = plain.at(starts(plain))
    worse = effect.apply(world, {name: torch.tensor(value) for name, value in values.items()})
    law, slack = worse.simulator.force(effect.name), worse.simulator.force("wrinkling")
    constants = {name: law.value(name) for name in law.constants}
    stiffness, rest = constants["stiffness"], torch.ones_like(constants["stiffness"])
    memory = torch.zeros_like(rest)
    extra = {} if effect.name == "damage" else {"dt": torch.tensor(0.1)}

    def tension(length):
        lost, kept = law.law(length * rest, rest, **constants, **{next(iter(law.memory)): memory}, **extra)
        own = {name: slack.value(name) for name in slack.constants}
        return stiffness * (length - 1.0) * rest + slack.law(length * rest, rest, **own) + lost, kept

    for length in (1.0, 1.05, 1.1, 1.1, 1.1):
        _, memory = tension(length)
    nearer, farther = (tension(length)[0] / stiffness for length in (0.95, 0.85))
    assert (nearer <= 1e-9).all()
    assert (farther <= nearer + 1e-9).all()
    assert (farther >= -(1.0 - SLACKNESS) * 0.3).all()


def test_what_hangs_hangs_from_springs_that_pull(hung):
    """Cloth is at rest in the first frame, though its springs bear hardly any compression."""
    twin = plain_of(hung).twin
    pulls, presses = (twin.rest.tensions * sign for sign in (1.0, -1.0))
    assert presses.clip(0.0).sum() < 0.1 * pulls.clip(0.0).sum()
    pull = np.zeros_like(twin.body.points)
    way = np.diff(twin.body.points[twin.body.springs], axis=1)[:, 0]
    pulls = twin.rest.tensions[:, None] * way / np.linalg.norm(way, axis=1, keepdims=True)
    np.add.at(pull, twin.body.springs[:, 0], pulls)
    np.add.at(pull, twin.body.springs[:, 1], -pulls)
    weight = twin.matter.mass[:, None] * np.asarray(hung.gravity)
    left = np.linalg.norm(pull + twin.rest.supports + weight, axis=1)
    assert left.mean() < 0.1 * np.linalg.norm(weight, axis=1).mean()


def test_how_it_bends_and_comes_to_rest_is_free(hung):
    """Each of many worlds has its own, and moves as it does alone."""
    plain = plain_of(hung)
    usual = starts(plain)
    tried = [usual, usual | {"bending": 3.0}, usual | {"bending_decay": 1000.0}]
    columns = {name: torch.tensor([[one[name]] for one in tried], dtype=torch.float64) for name in usual}
    with torch.no_grad():
        together = plain(columns).rollout(substeps=120).points
        alone = [plain.at(one).rollout(substeps=120).points for one in tried]
    for i, one in enumerate(alone):
        np.testing.assert_allclose(together[:, i], one, atol=2e-5)
    for other in alone[1:]:
        assert float((other - alone[0]).abs().max()) > 1e-3
