"""Descent along gradients of rollouts, as the fits of the papers do it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from model.simulator.divergence import SimulationDiverged

SUDDEN = 5.0
"""A gradient more than so many times the usual one is shortened to that: contacts make such."""


@dataclass(frozen=True)
class Free:
    """Tensors that may change, and how."""

    tensors: Sequence[Tensor]
    """Leaves that require gradients; changed in place."""
    rate: float
    """Of a step, in their unit."""
    low: float = -math.inf
    high: float | Tensor = math.inf


def descend(loss: Callable[[], Tensor], free: Sequence[Free], iterations: int) -> float:
    """Minimise by Adam with rates that fall off as a cosine; returns the least loss, its place kept.

    Where a rollout diverges, or a gradient is not finite, the best place so far is taken up again and rates
    are halved.

    Raises:
        SimulationDiverged: nothing is finite at the start.

    Reference:
        Kingma and Ba (2015), Adam: a method for stochastic optimization, ICLR.
    """
    groups = [{"params": list(each.tensors), "lr": each.rate} for each in free]
    optimiser = torch.optim.Adam(groups)
    best, least = _copy(free), math.inf
    usual, scale = list[float](), 1.0
    for iteration in range(iterations + 1):
        value = _slope(loss, optimiser, first=iteration == 0)
        norm = _norm(free)
        if value is None or not math.isfinite(norm):
            _restore(free, best)
            scale /= 2.0
            continue
        if value < least:
            best, least = _copy(free), value
        if iteration == iterations:
            break
        usual.append(norm)
        _shorten(free, norm, SUDDEN * sorted(usual)[len(usual) // 2])
        fall = 0.5 * (1.0 + math.cos(math.pi * iteration / max(1, iterations)))
        for group, each in zip(optimiser.param_groups, free, strict=True):
            group["lr"] = each.rate * scale * max(fall, 0.05)
        optimiser.step()
        _keep_within(free)
    _restore(free, best)
    return least


def _slope(loss: Callable[[], Tensor], optimiser: torch.optim.Optimizer, first: bool) -> float | None:
    """The loss, with its gradients in the leaves; None: not finite."""
    optimiser.zero_grad()
    try:
        value = loss()
        torch.autograd.backward(value)
    except SimulationDiverged:
        if first:
            raise
        return None
    found = float(value.detach())
    return found if math.isfinite(found) else None


def _norm(free: Sequence[Free]) -> float:
    squares = [t.grad.double().square().sum() for each in free for t in each.tensors if t.grad is not None]
    return math.sqrt(float(torch.stack(squares).sum())) if squares else 0.0


def _shorten(free: Sequence[Free], norm: float, most: float) -> None:
    if norm > most > 0.0:
        for each in free:
            for tensor in each.tensors:
                if tensor.grad is not None:
                    tensor.grad.mul_(most / norm)


def _keep_within(free: Sequence[Free]) -> None:
    with torch.no_grad():
        for each in free:
            for tensor in each.tensors:
                high = torch.as_tensor(each.high, dtype=tensor.dtype)
                tensor.copy_(torch.minimum(tensor.clamp_min(each.low), high))


def _copy(free: Sequence[Free]) -> list[list[Tensor]]:
    return [[tensor.detach().clone() for tensor in each.tensors] for each in free]


def _restore(free: Sequence[Free], places: Sequence[Sequence[Tensor]]) -> None:
    with torch.no_grad():
        for each, place in zip(free, places, strict=True):
            for tensor, value in zip(each.tensors, place, strict=True):
                tensor.copy_(value)
