import torch

from model.predictor.joining import join_samples


def test_indices_point_at_what_they_pointed_at(make_case, sample_of):
    samples = [sample_of(make_case(seed, frames=3), seed) for seed in (0, 1)]
    joined = join_samples([*samples, samples[0]])
    assert joined.case_count == 3
    assert joined.part_scene.tolist() == [0, 0, 1, 1, 2, 2]
    points, springs, parts = len(samples[0].point_part), len(samples[0].edges), 2
    last = slice(2 * springs, None)
    torch.testing.assert_close(joined.motion[joined.edges[last]], samples[0].motion[samples[0].edges])
    torch.testing.assert_close(joined.edge_part[last], samples[0].edge_part + 2 * parts)
    assert int(joined.edges[last].min()) == 2 * points
    grips = len(samples[0].grips)
    torch.testing.assert_close(joined.motion[joined.grips[-grips:]], samples[0].motion[samples[0].grips])
    modulus = joined.prior_log_modulus[joined.point_part[-points:]]
    torch.testing.assert_close(modulus, samples[0].prior_log_modulus[samples[0].point_part])


def test_one_sample_joined_is_itself(make_case, sample_of):
    sample = sample_of(make_case(frames=3))
    for (name, one), (_, other) in zip(sample.tensors(), join_samples([sample]).tensors(), strict=True):
        assert torch.equal(one, other), name
