import numpy as np
import pytest
import torch

from model.evaluation.baselines.graph_dynamics import FASTER, HISTORY, Dynamics, GraphDynamics, Scales
from model.evaluation.baselines.hold_last import HoldLast
from model.evaluation.baselines.particles import choose, graph

SMALL = {"particles": 16, "width": 24, "passes": 2, "future": 3, "batch": 4}


@pytest.fixture(scope="module")
def case(make_case):
    return make_case(frames=14)


@pytest.fixture(scope="module")
def fitted(case, hide):
    return GraphDynamics(**SMALL, steps=120, rate=5e-3).fit(hide(case))


def test_untrained_it_lets_things_go_on_and_controllers_are_where_they_are(case):
    particles = graph(case, choose(case, 16), 5)
    dynamics = Dynamics(Scales(0.02, 0.01), 8, 1, 0)
    speed = torch.tensor([0.01, 0.0, 0.02])
    history = torch.stack([particles.rest + n * speed for n in range(HISTORY)])[None]
    held = particles.rest[16:] + 1.0
    after = dynamics(particles, history, held[None])[0]
    assert torch.allclose(after[:16], particles.rest[:16] + HISTORY * speed, atol=1e-6)
    assert torch.equal(after[16:], held)


def test_it_learns_what_it_sees(case, hide, errors, fitted):
    blank = GraphDynamics(**SMALL, steps=0).fit(hide(case))
    assert errors(case, fitted)[0] < 0.6 * errors(case, blank)[0]
    assert errors(case, fitted)[0] < 0.5 * errors(case, HoldLast().fit(hide(case)))[0]


def test_the_future_goes_on_from_where_the_object_was_last_seen(case, hide):
    blank = GraphDynamics(**SMALL, steps=0).fit(hide(case))
    seen = case.observation.points
    step = blank.predict(hide(case))[case.split] - seen[case.split - 1]
    expected = seen[case.split - 1] - seen[case.split - 2]
    assert np.abs(step - expected).mean() < 0.5 * np.abs(expected).mean()


def test_another_interaction_begins_at_rest(make_case, hide, errors, fitted):
    other = make_case(frames=10, lift=0.2, name="other")
    made = fitted.predict(hide(other))
    assert np.abs(made[0] - other.rest).max() < 5e-3
    assert errors(other, fitted)[0] < 0.9 * errors(other, HoldLast().fit(hide(other)))[0]


def test_the_same_seed_learns_the_same(case, hide):
    made = [GraphDynamics(**SMALL, steps=3).fit(hide(case)).predict(hide(case)) for _ in range(2)]
    assert np.array_equal(made[0], made[1])


def test_a_network_gone_wild_moves_nothing_much_faster_than_was_seen_or_falls(case, hide, make_case):
    fitted = GraphDynamics(**SMALL, steps=0).fit(hide(case))
    with torch.no_grad():
        for parameter in fitted.dynamics.parameters():
            parameter.add_(3.0 * torch.randn(parameter.shape, generator=torch.Generator().manual_seed(0)))
    other = make_case(frames=10, lift=0.2, name="other")
    made, controls = fitted.predict(hide(other)), other.observation.controllers
    fall = np.sqrt(2.0 * 9.81 * (other.rest[:, 2].max() - (other.observation.ground_height or 0.0)))
    hands = np.linalg.norm(np.diff(controls, axis=0), axis=-1).max()
    farthest = FASTER * max(max(fitted.fastest, fall) * np.diff(other.observation.times).mean(), hands)
    gone = np.linalg.norm(np.diff(made, axis=0), axis=-1)
    # points between particles go with several of them
    assert 0.9 * farthest < gone.max() < 1.05 * farthest
