from dataclasses import replace

import numpy as np

from model.evaluation.baselines.particles import choose, followed, graph


def test_particles_are_spread_over_the_object(make_case):
    case = make_case(frames=6)
    chosen = choose(case, 20)
    assert len(set(chosen.tolist())) == 20
    apart = np.linalg.norm(case.topology.points[:, None] - case.topology.points[chosen], axis=2).min(axis=1)
    assert apart.max() < 0.04
    assert len(choose(case, 1000)) == len(case.topology.points)


def test_the_graph_joins_neighbours_both_ways_and_controllers_one_way(make_case):
    case = make_case(frames=6)
    particles = graph(case, choose(case, 30), 5)
    assert particles.count == 30
    assert len(particles.rest) == 30 + len(case.topology.controller_points)
    pairs = {tuple(pair) for pair in particles.pairs.tolist()}
    own = {pair for pair in pairs if pair[0] < 30}
    assert own == {(b, a) for a, b in own}
    grips = pairs - own
    assert {sender for sender, _ in grips} == set(range(30, len(particles.rest)))
    assert all(receiver < 30 for _, receiver in pairs)


def test_a_controller_that_does_not_touch_the_object_tells_no_particle(make_case):
    case = make_case(frames=6)
    touching = case.topology.controller_springs[:, 0] != 0
    topology = replace(
        case.topology,
        controller_springs=case.topology.controller_springs[touching],
        controller_rest_length=case.topology.controller_rest_length[touching],
    )
    particles = graph(replace(case, topology=topology), choose(case, 30), 5)
    senders = set(particles.pairs[:, 0].tolist())
    assert 30 not in senders
    assert set(range(31, len(particles.rest))) <= senders


def test_observed_points_follow_the_particles(make_case):
    case = make_case(frames=6)
    particles = graph(case, choose(case, 30), 5)
    rest = particles.rest[:30].numpy()
    made = (rest[particles.anchors.index] * particles.anchors.weight[..., None]).sum(axis=1)
    assert np.abs(made - case.rest).max() < 2e-3


def test_particles_follow_what_was_seen_of_them(make_case):
    case = make_case(frames=12)
    rest = case.topology.points[choose(case, 30)]
    offset = np.linspace(0.0, 0.1, 12, dtype=np.float32)[:, None, None] * np.float32([1.0, 0.0, 0.5])
    case.observation.points[:] = case.rest + offset
    case.observation.points[3, ::2] = np.nan
    case.observation.points[5] = np.nan
    case.observation.points[case.split :] = np.nan
    tracks = followed(case, rest)
    assert tracks.shape == (case.split, 30, 3)
    seen = [frame for frame in range(case.split) if frame != 5]
    assert np.allclose(tracks[seen], (rest + offset[: case.split])[seen], atol=1e-6)
    assert np.array_equal(tracks[5], tracks[4])


def test_an_object_that_nothing_holds_is_a_graph_too(make_case):
    case = make_case(frames=6)
    free = replace(
        case.topology,
        controller_points=case.topology.controller_points[:0],
        controller_springs=case.topology.controller_springs[:0],
        controller_rest_length=case.topology.controller_rest_length[:0],
    )
    seen = replace(case.observation, controllers=case.observation.controllers[:, :0])
    particles = graph(replace(case, topology=free, observation=seen), choose(case, 30), 5)
    assert len(particles.rest) == particles.count == 30
