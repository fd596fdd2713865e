"""The network: what was seen, what is believed and how a body is built → its mechanics, in one pass."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor, nn

from model.predictor.attention import AttentionPool, Mixer
from model.predictor.beliefs import BELIEFS
from model.predictor.codebook import Codebook, WithoutCodebook
from model.predictor.decoders import EdgeDecoder, GlobalDecoder, GripDecoder, PartDecoder
from model.predictor.geometry import EDGE_FEATURES, GRIP_FEATURES, PART_FEATURES, SCENE_FEATURES
from model.predictor.joining import join_samples
from model.predictor.layers import Standardise, mean_by, perceptron
from model.predictor.sample import GLOBALS, Prediction, Sample
from model.predictor.views import WithoutGeometry, WithoutMotion, WithoutParts

MATERIAL = 32
"""Length of a material's embedding."""


class _Read(NamedTuple):
    """What the heads read."""

    moved: Float[Tensor, "P d"]
    """Motion of each point."""
    material: Float[Tensor, "K C"]
    numbers: Float[Tensor, "K i"]
    """Material and numbers of each part."""
    pooled: Float[Tensor, "K d"]
    """Motion of each part."""
    token: Float[Tensor, "K d"]
    """Of each part, having looked at the others."""
    scene: Float[Tensor, "B d"]
    """Of each case, having looked at its parts."""
    scenery: Float[Tensor, "B j"]
    """Numbers of each case."""


class PredictorNetwork(nn.Module):
    r"""Predicts ln of a modulus per spring and the global parameters as differences to the prior's means.

    Points' motion is pooled by attention into a token per part, which also reads the part's material
    (belief × codebook) and its numbers; a small transformer lets the tokens of a case and of its parts look
    at each other. A part's modulus is its prior's mean times e to what its token says; each spring adds what
    motion, material and geometry around it say. A spring across a border stands between its two parts: its
    inputs are their means, and so is its ln of a modulus, as in `lattice_stiffness`.

    The dashpot follows the modulus: a prior's damping ratio ζ means $c = 2\zeta\sqrt{km}$, so half of what is
    added to ln k is added to ln c before its own difference.

    A sample may hold several cases; they do not see each other.

    Args:
        motion_dim: Motion features per mass point.
        motion_global_dim: Motion features per clip.
        dim: Length of a token.
        layers: Of the transformer.
        heads: Of attention.
        dropout: Share of activations left out in training.
        codebook: False: ablation `WithoutCodebook`.
        parts: False: ablation `WithoutParts`.
        motion: False: ablation `WithoutMotion`.
        geometry: False: ablation `WithoutGeometry`.

    Reference:
        The layout (codebook of materials, three inputs to the decoder of springs, mean over a border) follows
        the MatPhys paper; tokens of parts, soft limits and spreads are our own.
    """

    part_scale: Tensor
    global_scale: Tensor

    def __init__(
        self,
        *,
        motion_dim: int,
        motion_global_dim: int,
        dim: int = 64,
        layers: int = 2,
        heads: int = 4,
        dropout: float = 0.1,
        codebook: bool = True,
        parts: bool = True,
        motion: bool = True,
        geometry: bool = True,
    ) -> None:
        """Put the network together; ablations take a module out or put one in between."""
        super().__init__()
        ablations = {WithoutParts: parts, WithoutMotion: motion, WithoutGeometry: geometry}
        self.view = nn.Sequential(*(ablation() for ablation, seen in ablations.items() if not seen))
        self.material = Codebook(MATERIAL) if codebook else WithoutCodebook(MATERIAL)
        part_dim, scene_dim = PART_FEATURES + BELIEFS, SCENE_FEATURES + motion_global_dim + 2 * len(GLOBALS)
        self.point_input, self.edge_input = Standardise(motion_dim), Standardise(EDGE_FEATURES)
        self.part_input, self.scene_input = Standardise(part_dim), Standardise(scene_dim)
        self.grip_input = Standardise(GRIP_FEATURES)
        self.point_motion = perceptron(motion_dim, dim, dropout)
        self.geometry = perceptron(EDGE_FEATURES, dim, dropout)
        self.query = nn.Linear(MATERIAL + part_dim, dim)
        self.pool = AttentionPool(dim, heads)
        self.part_token = perceptron(dim + MATERIAL + part_dim, dim, dropout)
        self.scene_token = perceptron(scene_dim, dim, dropout)
        self.mixer = Mixer(dim, layers, heads, dropout)
        # heads also see the numbers themselves, whose size the normalised tokens no longer tell
        self.part_decoder = PartDecoder(3 * dim + MATERIAL + part_dim, dim, dropout)
        self.edge_decoder = EdgeDecoder(3 * dim + MATERIAL, dim, dropout)
        self.grip_decoder = GripDecoder(2 * dim + GRIP_FEATURES, dim, dropout)
        self.global_decoder = GlobalDecoder(2 * dim + scene_dim, dim, dropout)
        self.register_buffer("part_scale", torch.ones(()))
        self.register_buffer("global_scale", torch.ones(len(GLOBALS)))

    def forward(self, sample: Sample) -> Prediction:
        """Predict; the answer has the springs, parts and cases of the sample, in their order."""
        seen: Sample = self.view(sample)
        read = self._read(seen)
        shift, spread = self._parts(read, seen)
        part = seen.prior_log_modulus + shift
        local, sureness = self._springs(read, seen)
        part_spread = spread * self.part_scale
        change = shift + _inner_mean(local, seen)
        mean, global_spread = self._globals(read, seen, change)
        back = _same_parts(sample, seen)
        return Prediction(
            log_modulus=_between(part, seen) + local,
            log_modulus_spread=part_spread[seen.edge_part].mean(dim=1) * sureness,
            part_log_modulus=(seen.prior_log_modulus + change)[back],
            part_log_spread=part_spread[back],
            log_controller_stiffness=seen.log_grip_anchor + self._grips(read, seen, change),
            global_mean=mean,
            global_log_spread=global_spread * self.global_scale,
        )

    def _read(self, seen: Sample) -> _Read:
        moved = self.point_motion(self.point_input(seen.motion))
        material = self.material(seen.distribution)
        numbers = torch.cat([material, self.part_input(seen.part_features)], dim=-1)
        pooled = self.pool(moved, self.query(numbers), seen.point_part)
        token = self.part_token(torch.cat([pooled, numbers], dim=-1))
        scenery = self.scene_input(_scenery(seen))
        scene, token = self.mixer(self.scene_token(scenery), token, seen.part_scene)
        return _Read(moved, material, numbers, pooled, token, scene, scenery)

    def _parts(self, read: _Read, seen: Sample) -> tuple[Tensor, Tensor]:
        """Difference to the prior's ln modulus, and the spread, of each part."""
        inputs = [read.token, read.pooled, read.scene[seen.part_scene], read.numbers]
        shift, spread = self.part_decoder(torch.cat(inputs, dim=-1), seen.prior_log_spread)
        return shift, spread

    def _springs(self, read: _Read, seen: Sample) -> tuple[Tensor, Tensor]:
        """Difference to the parts' ln modulus, and a factor on their spread, of each spring."""
        ends = [read.moved[seen.edges], read.material[seen.edge_part], read.token[seen.edge_part]]
        shape = self.geometry(self.edge_input(seen.edge_features))
        local, sureness = self.edge_decoder(torch.cat([*(both.mean(dim=1) for both in ends), shape], dim=-1))
        return local, sureness

    def _grips(self, read: _Read, seen: Sample, change: Tensor) -> Tensor:
        """Difference to the prior's ln stiffness of each controller spring: firmer where what it holds is."""
        held = seen.point_part[seen.grips]
        inputs = [read.moved[seen.grips], read.token[held], self.grip_input(seen.grip_features)]
        firmness: Tensor = self.grip_decoder(torch.cat(inputs, dim=-1))
        return change[held] + firmness

    def _globals(self, read: _Read, seen: Sample, change: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and spread of `GLOBALS`; the dashpot follows what changed of the moduli by its root."""
        inputs = [read.scene, _weighed(read.token, seen), read.scenery]
        offset, spread = self.global_decoder(torch.cat(inputs, dim=-1), seen.global_spread)
        follows = torch.zeros_like(offset[:, 1:])
        follows = torch.cat([0.5 * _weighed(change[:, None], seen), follows], dim=-1)
        return seen.global_anchor + follows + offset, spread

    def standardise(self, samples: Sequence[Sample]) -> None:
        """Fit the scales of the inputs to these samples, which should be those of the training set."""
        seen: Sample = self.view(join_samples(samples))
        self.point_input.fit(seen.motion)
        self.edge_input.fit(seen.edge_features)
        self.part_input.fit(seen.part_features)
        self.scene_input.fit(_scenery(seen))
        if len(seen.grips):
            self.grip_input.fit(seen.grip_features)

    def calibrate(self, part_scale: float, global_scale: Float[np.ndarray, "4"]) -> None:
        """Multiply spreads from now on: of moduli, and of each of `GLOBALS`; replaces earlier factors."""
        self.part_scale.fill_(part_scale)
        self.global_scale.copy_(torch.as_tensor(global_scale))


def _scenery(sample: Sample) -> Float[Tensor, "B i"]:
    """All that is known of a case as a whole."""
    beliefs = [sample.global_anchor, sample.global_spread]
    return torch.cat([sample.scene_features, sample.motion_global, *beliefs], dim=-1)


def _between(log_modulus: Float[Tensor, " K"], sample: Sample) -> Float[Tensor, " E"]:
    """Mean of both ends' logarithms: the part's own where both are of one part."""
    return log_modulus[sample.edge_part].mean(dim=-1)


def _inner_mean(local: Float[Tensor, " E"], sample: Sample) -> Float[Tensor, " K"]:
    """Mean over the springs that lie within each part; 0 for a part that has none."""
    inner = sample.edge_part[:, 0] == sample.edge_part[:, 1]
    return mean_by(local[inner], sample.edge_part[inner, 0], len(sample.part_scene))


def _weighed(values: Float[Tensor, "K d"], sample: Sample) -> Float[Tensor, "B d"]:
    """Mean over the parts of each case by their volume."""
    total = values.new_zeros(sample.case_count, values.shape[1])
    return total.index_add(0, sample.part_scene, sample.part_share[:, None] * values)


def _same_parts(sample: Sample, seen: Sample) -> Int64[Tensor, " K"]:
    """Of every part of the sample, which part the network saw in its place."""
    if len(seen.part_scene) == len(sample.part_scene):
        return torch.arange(len(sample.part_scene), device=sample.part_scene.device)
    return sample.part_scene
