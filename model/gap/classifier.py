"""From signs to probabilities of {none, each effect, unknown}, by jurors that have seen many worlds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Final

import numpy as np
import torch
from jaxtyping import Float64
from safetensors.torch import load
from torch import Tensor, nn

from model.gap.schema import EFFECT_NAMES, VerdictName
from model.gap.signs import CONTEXT_NAMES, SIGN_NAMES, Signs
from model.types import Array

NONE: Final = "none"
UNKNOWN: Final = "unknown"
CLASSES: tuple[VerdictName, ...] = (*EFFECT_NAMES, NONE, UNKNOWN)
LOOKED_AT = 3
"""Effects whose scores the judge of none and unknown sees."""
WEIGHTS = "verdict.safetensors"


class Juror(nn.Module):
    """Scores all effects by the same few weights, none and unknown by a few others.

    What is learned of one effect so holds for all; beyond that each has one number of its own, how often it
    is at work when it looks as if it were. Hidden layers learned some dozens of worlds by heart.
    """

    sign_mean: Tensor
    sign_size: Tensor
    context_mean: Tensor
    context_size: Tensor
    temperature: Tensor
    caution: Tensor

    def __init__(self) -> None:
        """Untrained."""
        super().__init__()
        self.scorer = nn.Linear(len(SIGN_NAMES), 1)
        self.judge = nn.Linear(len(CONTEXT_NAMES) + LOOKED_AT, 2)
        self.bias = nn.Parameter(torch.zeros(len(EFFECT_NAMES)))
        self.register_buffer("sign_mean", torch.zeros(len(SIGN_NAMES)))
        self.register_buffer("sign_size", torch.ones(len(SIGN_NAMES)))
        self.register_buffer("context_mean", torch.zeros(len(CONTEXT_NAMES)))
        self.register_buffer("context_size", torch.ones(len(CONTEXT_NAMES)))
        self.register_buffer("temperature", torch.ones(1))
        self.register_buffer("caution", torch.zeros(1))

    def forward(self, each: Tensor, able: Tensor, context: Tensor) -> Tensor:
        """Logarithms of the probabilities of `CLASSES`.

        Args:
            each: Signs, shape [b, 17, s].
            able: Which effects could act, shape [b, 17], bool.
            context: Shape [b, c].
        """
        signs = ((each - self.sign_mean) / self.sign_size).clamp(-4, 4)
        seen = ((context - self.context_mean) / self.context_size).clamp(-4, 4)
        scores = self.scorer(signs).squeeze(-1) + self.bias
        scores = scores.masked_fill(~able, -30.0)
        top = scores.topk(LOOKED_AT, dim=1).values.clamp(-10, 10)
        others = self.judge(torch.cat([seen, top / 3.0], -1))
        logs = torch.log_softmax(torch.cat([scores, others], 1), 1) / self.temperature
        none = torch.zeros(logs.shape[1]).index_fill_(0, torch.tensor([CLASSES.index(NONE)]), 1.0)
        return torch.log_softmax(logs + self.caution * none, 1)


def table(signs: Sequence[Signs]) -> tuple[Tensor, Tensor, Tensor]:
    """Signs of several recordings, whether effects could act, and contexts, as a juror wants them."""
    each = torch.zeros(len(signs), len(EFFECT_NAMES), len(SIGN_NAMES))
    able = torch.zeros(len(signs), len(EFFECT_NAMES), dtype=torch.bool)
    for i, one in enumerate(signs):
        for name, row in zip(one.names, one.each, strict=True):
            each[i, EFFECT_NAMES.index(name)] = torch.from_numpy(row).float()
            able[i, EFFECT_NAMES.index(name)] = True
    context = torch.stack([torch.from_numpy(one.context).float() for one in signs])
    return each, able, context


@dataclass(frozen=True)
class Jury:
    """Several jurors, whose probabilities are averaged."""

    jurors: tuple[Juror, ...]

    @classmethod
    def shipped(cls) -> "Jury":
        """The one that comes with the package."""
        return cls.of(load(files("model.gap").joinpath(WEIGHTS).read_bytes()))

    @classmethod
    def of(cls, tensors: Mapping[str, Tensor]) -> "Jury":
        """From named tensors, those of juror i called `i.name`."""
        count = 1 + max(int(name.split(".")[0]) for name in tensors)
        jurors = []
        for i in range(count):
            juror = Juror()
            own = {n.removeprefix(f"{i}."): t for n, t in tensors.items() if n.startswith(f"{i}.")}
            juror.load_state_dict(own)
            jurors.append(juror.eval())
        return cls(tuple(jurors))

    def tensors(self) -> dict[str, Tensor]:
        """As `of` reads them."""
        return {
            f"{i}.{name}": tensor.contiguous()
            for i, juror in enumerate(self.jurors)
            for name, tensor in juror.state_dict().items()
        }

    def probabilities(self, signs: Sequence[Signs]) -> Float64[Array, "b k"]:
        """Of `CLASSES`, for each recording."""
        with torch.no_grad():
            each = [juror(*table(signs)).exp() for juror in self.jurors]
        mean: Float64[Array, "b k"] = torch.stack(each).mean(0).double().numpy()
        return np.asarray(mean / mean.sum(1, keepdims=True), np.float64)
