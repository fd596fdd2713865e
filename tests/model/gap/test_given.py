from dataclasses import replace

import numpy as np
import pytest
import torch

from model.bundle import TwinBundle
from model.errors import InputError
from model.gap.bodies.body import body_of
from model.gap.by_graph import by_graph
from model.gap.carried import record_of
from model.gap.effects import BendingStiffness, GroundAdhesion, Plasticity, QuadraticAirDrag
from model.gap.given import bound, given_twin
from model.gap.graph import Graph
from model.gap.hypothesis import Hypothesis
from model.gap.plain import PlainTwin
from model.schema import EffectRecord
from model.simulator.structure import rows, spans
from model.types import Observation, Parameter


@pytest.fixture
def twin(twin_path) -> TwinBundle:
    """The foreign cube without contact, which a graph has and an observation does not tell."""
    bundle = TwinBundle.load(twin_path)
    free = {**bundle.parameters.globals, "collision_distance": Parameter(0.0, "m", "user")}
    return replace(bundle, parameters=replace(bundle.parameters, globals=free))


def filmed(twin: TwinBundle, every: int = 2) -> Observation:
    times = np.arange(5) / 30
    points = twin.rollout(substeps=200).points
    return Observation(times=times, points=points[:, ::every], controllers=twin.controls)


def at_world(plain):
    hypothesis = Hypothesis(plain)
    return hypothesis.at({name: q.start for name, q in hypothesis.quantities.items()})


def at_start(plain):
    world = at_world(plain)
    with torch.no_grad():
        return world.sight(world.rollout(substeps=200).points).numpy()


def test_its_start_is_the_twin_as_it_came(twin):
    observation = filmed(twin)
    moved = np.abs(observation.points - observation.points[0]).max()
    error = np.abs(at_start(given_twin(twin, observation)) - observation.points).max()
    assert error < 0.01 * moved


def test_effects_that_it_carries_go_on(twin):
    slowed = replace(twin, effects=(record_of(QuadraticAirDrag, {"drag_per_mass": 30.0, "facing": 0.5}),))
    observation = filmed(slowed)
    with_it, without = (
        np.abs(at_start(given_twin(t, observation)) - observation.points).max() for t in (slowed, twin)
    )
    assert with_it < 0.1 * without


def test_those_that_cannot_act_in_a_recording_are_left_out(twin):
    sticky = record_of(GroundAdhesion, {"pull_per_mass": 5.0, "reach": 0.01, "at_contact": 0.0})
    sticking = replace(
        twin, effects=(sticky, record_of(QuadraticAirDrag, {"drag_per_mass": 30.0, "facing": 0.5}))
    )
    plain = given_twin(sticking, filmed(twin))
    assert plain.observation.ground_height is None
    names = set(at_world(plain).simulator.forces)
    assert "quadratic_air_drag" in names
    assert "adhesion" not in names
    on_table = replace(filmed(twin), ground_height=float(twin.topology.points[:, 2].min()))
    with pytest.warns(UserWarning, match="the observation has a ground"):
        lying = given_twin(sticking, on_table)
    assert "adhesion" in at_world(lying).simulator.forces


def test_springs_of_the_hand_without_stiffness_hold_nothing(twin):
    stiffness = twin.parameters.controller_stiffness.copy()
    assert len(stiffness) > 1
    stiffness[1:] = 0.0
    loose = replace(twin, parameters=replace(twin.parameters, controller_stiffness=stiffness))
    plain = given_twin(loose, filmed(loose))
    np.testing.assert_array_equal(plain.body.grip, twin.topology.controller_springs[:1])
    assert np.isfinite(at_start(plain)).all()


def test_a_finer_twin_is_made_coarser(twin):
    observation = filmed(twin)
    whole = tuple(float(z) for z in twin.topology.points[:, 2] > 0.29)
    here = replace(
        twin,
        effects=(
            record_of(QuadraticAirDrag, {"drag_per_mass": 3.0, "facing": 0.5}).model_copy(
                update={"acts_on": whole}
            ),
        ),
    )
    with pytest.warns(UserWarning, match=r"27 points were merged into \d+"):
        plain = given_twin(here, observation, most=20)
    count = len(plain.body.points)
    assert count <= 20
    assert len(plain.carried[0].acts_on) == count
    assert sum(plain.carried[0].acts_on) > 0
    moved = np.abs(observation.points - observation.points[0]).max()
    assert np.abs(at_start(plain) - observation.points).mean() < 0.3 * moved


def test_what_goes_by_the_graph_is_carried_as_the_coarser_one_has_it(twin):
    """As long a distance, as much bending in sum; bare numbers too, and what is absent stays absent."""
    bending = record_of(BendingStiffness, {"bending_stiffness": 1e-4, "memory_of_shape": 0.5})
    yields = {"flow_rate": 9.0, "yield_strain": 0.1, "hardening": 0.0, "yield_curvature": 3.0}
    contact = EffectRecord(name="self_collision", parameters={"distance": 0.6, "friction": 0.3})
    none = EffectRecord(name="self_collision", parameters={"distance": 0.0, "friction": 0.3})
    fine, (graph, _) = Graph.of(twin), Graph.of(twin).within(20)
    both = replace(twin, effects=(bending, contact))
    with pytest.warns(UserWarning, match="merged"):
        stiff, near = given_twin(both, filmed(twin), 20).carried
    sums = [spans(one.points, rows(one.points, one.springs)).sum() for one in (fine, graph)]
    assert sums[0] / sums[1] != pytest.approx(1.0, abs=0.01)
    assert stiff.parameters["bending_stiffness"]["value"] == pytest.approx(1e-4 * sums[0] / sums[1])
    assert stiff.parameters["memory_of_shape"] == bending.parameters["memory_of_shape"]
    yielding = by_graph(record_of(Plasticity, {**yields, "bending_stiffness": 1e-4}), fine, graph)
    assert yielding.parameters["bending_stiffness"]["value"] == pytest.approx(1e-4 * sums[0] / sums[1])
    assert yielding.parameters["yield_curvature"]["value"] == 3.0
    assert near.parameters["distance"] * graph.spacing == pytest.approx(0.6 * fine.spacing)
    assert by_graph(none, fine, graph) == none
    assert given_twin(both, filmed(twin)).carried == both.effects


def test_another_hand_holds_what_is_near_it(twin):
    observation = filmed(twin)
    corner = np.repeat(observation.points[:1, :1], 5, axis=0)
    with pytest.warns(
        UserWarning, match="do not start where the twin's do: how firmly they hold it is a guess"
    ):
        plain = given_twin(twin, replace(observation, controllers=corner))
    away = np.linalg.norm(plain.body.points - corner[0, 0], axis=1)
    assert away.argmin() in plain.body.grip[:, 1]
    assert away[plain.body.grip[:, 1]].max() < 0.07
    assert plain.quantities["grip"].start == 3.0
    assert plain.quantities["stiffness"].start == np.median(twin.parameters.stiffness)


def test_a_hand_that_is_not_seen_holds_nothing(twin):
    nobody = replace(filmed(twin), controllers=np.zeros((5, 0, 3), np.float32))
    plain = given_twin(twin, nobody)
    assert len(plain.body.grip) == 0
    assert "grip" not in plain.quantities


def test_a_hand_that_is_too_far_away_is_not_passed_over(twin):
    """It holds nothing: what does not fall all the same is refused, and of what lies it is a doubt."""
    seen = filmed(twin)
    times = np.arange(12) / 30
    still = np.repeat(seen.points[:1], 12, axis=0)
    away = np.repeat(still[:1].max(1, keepdims=True) + np.float32(0.4), 12, axis=0)
    lies = replace(
        seen, times=times, points=still, controllers=away, ground_height=float(still[..., 2].min())
    )
    with (
        pytest.warns(UserWarning, match="the observation has a ground, the twin none"),
        pytest.warns(UserWarning, match=r"the nearest is 0\.\d+ m .* it moves as if there was no hand"),
    ):
        plain = given_twin(twin, lies)
    assert len(plain.body.grip) == 0
    with pytest.raises(InputError, match="holds none of it, and yet the object does not fall"):
        given_twin(twin, replace(lies, ground_height=None))


def test_the_observation_says_where_the_ground_is(twin):
    with pytest.warns(UserWarning, match="the observation has a ground, the twin none"):
        plain = given_twin(twin, replace(filmed(twin), ground_height=0.1))
    assert plain.world({n: torch.tensor(q.start) for n, q in plain.quantities.items()}).ground_height == 0.1


def test_seen_points_are_bound_where_they_are(twin):
    points = twin.topology.points.astype(np.float64)
    rng = np.random.default_rng(2)
    inside = rng.uniform(points.min(0), points.max(0), (40, 3))
    seen = np.concatenate([inside, points[:3], np.full((1, 3), np.nan)])
    index, weight = bound(seen, points, 0.03)
    places = (weight[..., None] * points[index]).sum(1)
    assert np.abs(places - seen)[:-1].max() < 0.001
    assert np.abs(weight).max() < 1.6
    np.testing.assert_allclose(weight.sum(1), 1.0)


def test_it_is_known_for_given(twin, hung):
    assert given_twin(twin, filmed(twin)).given
    assert not PlainTwin.of(body_of(hung), hung).given
