"""Cases of mixed sizes as one batch: what the network reads, and what is true where that is known."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from model.predictor.joining import join_samples
from model.predictor.lattice import between
from model.predictor.sample import Sample
from model.scenes.case import Case

LEAST_BOUNCE = 1e-3
"""Restitution below and above which (from 1) its logit is not sought."""


@dataclass(frozen=True)
class TrueValues:
    """In the coordinates of a `Prediction`; NaN where nothing is known."""

    log_modulus: Float[Tensor, " E"]
    part_log_modulus: Float[Tensor, " K"]
    globals: Float[Tensor, "B 4"]

    def to(self, device: torch.device) -> "TrueValues":
        """Move to a device."""
        return TrueValues(
            self.log_modulus.to(device), self.part_log_modulus.to(device), self.globals.to(device)
        )


@dataclass(frozen=True)
class Example:
    """One case as the network sees it, under one opinion on its materials."""

    case: Case
    sample: Sample
    truth: TrueValues
    opinion: str | None = None
    """`right`, `uniform` or `wrong`; None: the priors that are stored with the case."""


@dataclass(frozen=True)
class Batch:
    """Several examples, their samples and truths joined in their order."""

    examples: tuple[Example, ...]
    sample: Sample
    truth: TrueValues

    def __len__(self) -> int:
        """The number of cases."""
        return len(self.examples)

    @property
    def cases(self) -> tuple[Case, ...]:
        """In their order."""
        return tuple(example.case for example in self.examples)

    def to(self, device: torch.device) -> "Batch":
        """Move what the network reads to a device; cases stay where the simulator is."""
        return replace(self, sample=self.sample.to(device), truth=self.truth.to(device))


def make_batch(examples: Sequence[Example]) -> Batch:
    """Join examples, of whatever sizes."""
    truths = [example.truth for example in examples]
    return Batch(
        examples=tuple(examples),
        sample=join_samples([example.sample for example in examples]),
        truth=TrueValues(
            torch.cat([truth.log_modulus for truth in truths]),
            torch.cat([truth.part_log_modulus for truth in truths]),
            torch.cat([truth.globals for truth in truths]),
        ),
    )


def true_values(case: Case, parts: int) -> TrueValues:
    """What the prediction of a case should have been.

    Springs have the moduli that they have in `lattice_stiffness`.

    Args:
        case: With or without a truth.
        parts: K, of its sample.
    """
    truth = case.truth
    if truth is None:
        springs = len(case.topology.springs)
        return TrueValues(_unknown(springs), _unknown(parts), _unknown(1, 4))
    logs = np.log(truth.modulus)
    ends = case.topology.part[case.topology.springs]
    bounce = np.clip(truth.restitution, LEAST_BOUNCE, 1.0 - LEAST_BOUNCE)
    positive = np.log(np.maximum([truth.dashpot_damping, truth.drag_rate, truth.friction], 1e-6))
    values = np.append(positive, np.log(bounce / (1.0 - bounce)))
    return TrueValues(
        torch.as_tensor(between(logs, ends), dtype=torch.float32),
        torch.as_tensor(logs, dtype=torch.float32),
        torch.as_tensor(values[None], dtype=torch.float32),
    )


def _unknown(*shape: int) -> Tensor:
    return torch.full(shape, torch.nan)
