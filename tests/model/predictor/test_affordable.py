import numpy as np
import pytest

from model.predictor.affordable import DAMPING_LIMIT, MARGIN, SUBSTEPS, affordable
from model.predictor.stability import fastest, stable_step


@pytest.fixture(scope="module")
def topology(make_case):
    return make_case(frames=3).topology


def substeps(topology, stiffness, held, dashpot):
    decay = dashpot * fastest(topology, np.ones(len(stiffness)), np.ones(len(held)))
    return MARGIN / (30.0 * stable_step(fastest(topology, stiffness, held), decay))


@pytest.mark.parametrize(("level", "dashpot"), [(10.0, 1e-3), (1e5, 1e-3), (1e5, 1e3), (1e-2, 1e3)])
def test_what_is_left_is_affordable_and_no_more_is_taken_than_needed(topology, level, dashpot):
    rng = np.random.default_rng(0)
    stiffness = level * rng.uniform(0.5, 2.0, len(topology.springs))
    held = level * rng.uniform(0.5, 2.0, len(topology.controller_springs))
    limit = affordable(topology, stiffness, held, dashpot)
    assert 0.0 < limit.stiffness <= 1.0
    left = (stiffness * limit.stiffness, held * limit.stiffness)
    needed = substeps(topology, *left, dashpot * limit.dashpot)
    assert needed <= SUBSTEPS * 1.01
    if limit.stiffness < 1.0:
        assert needed == pytest.approx(SUBSTEPS, rel=0.01)
    ones = (np.ones(len(stiffness)), np.ones(len(held)))
    share = dashpot * limit.dashpot * fastest(topology, *ones) / np.sqrt(fastest(topology, *left))
    assert share <= DAMPING_LIMIT * 1.01
    if limit.dashpot < 0.99 * np.sqrt(limit.stiffness):  # damping was cut for its own sake
        assert share == pytest.approx(DAMPING_LIMIT, rel=0.01)


def test_soft_and_calm_is_left_alone(topology):
    limit = affordable(
        topology, np.full(len(topology.springs), 5.0), np.full(len(topology.controller_springs), 5.0), 1e-3
    )
    assert (limit.stiffness, limit.dashpot) == (1.0, 1.0)
