"""Ablations of what the network sees: each takes one thing away from a sample and leaves the rest."""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor, nn

from model.predictor.sample import Sample


class WithoutMotion(nn.Module):
    """Ablation: nothing moved."""

    def forward(self, sample: Sample) -> Sample:
        """The sample with zeros for its motion."""
        still = torch.zeros_like(sample.motion)
        return replace(sample, motion=still, motion_global=torch.zeros_like(sample.motion_global))


class WithoutGeometry(nn.Module):
    """Ablation: all springs look alike."""

    def forward(self, sample: Sample) -> Sample:
        """The sample with zeros for the geometry of its springs and grips."""
        return replace(
            sample,
            edge_features=torch.zeros_like(sample.edge_features),
            grip_features=torch.zeros_like(sample.grip_features),
        )


class WithoutParts(nn.Module):
    """Ablation: every object is one part, of a material that is the mean of its parts' by volume."""

    def forward(self, sample: Sample) -> Sample:
        """The sample with one part per case."""
        scene, share = sample.part_scene, sample.part_share

        def pooled(values: Float[Tensor, "K ..."]) -> Float[Tensor, "B ..."]:
            weight = share.reshape(-1, *[1] * (values.ndim - 1))
            total = values.new_zeros(sample.case_count, *values.shape[1:])
            return total.index_add(0, scene, weight * values)

        mean = pooled(sample.prior_log_modulus)
        variance = pooled(sample.prior_log_spread**2 + (sample.prior_log_modulus - mean[scene]) ** 2)
        return replace(
            sample,
            edge_part=scene[sample.edge_part],
            point_part=scene[sample.point_part],
            part_scene=torch.arange(sample.case_count, device=scene.device),
            distribution=pooled(sample.distribution),
            prior_log_modulus=mean,
            prior_log_spread=variance.sqrt(),
            part_share=torch.ones_like(mean),
            part_features=pooled(sample.part_features),
        )
