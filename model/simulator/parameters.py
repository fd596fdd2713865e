"""The constants of a law as tensors that may be learned."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from model.errors import InputError

Over: TypeAlias = Literal["scene", "vector", "points", "springs", "controllers", "edges", "stencils"]
"""What a constant has one value for; `edges` are the springs followed by the controller springs, `stencils` a
term's own groups of points."""
TensorLike: TypeAlias = Tensor | np.ndarray | float | tuple[float, ...]
Values: TypeAlias = Mapping[str, Tensor]
Own = TypeVar("Own", bound="Parametric")


@dataclass(frozen=True)
class Constant:
    """What a law needs to know about one of its constants."""

    unit: str
    over: Over
    range: tuple[float, float]
    """Where its value plausibly lies; what fits search and property tests draw from."""
    positive: bool = True
    """Never below zero, so optimised by its logarithm."""


class Parametric(nn.Module):
    """Holds the values of declared constants.

    A value without gradients becomes the float64 parameter `log_<name>` (positive constants) or `<name>`,
    `requires_grad=False` until someone asks for it. A tensor that already requires gradients is kept as it
    is, under `<name>`: the caller owns its parameterisation, and gradients flow to the caller's leaf.
    Each value has one number, or as many as `Constant.over` says, and may have leading batch dimensions.
    """

    constants: ClassVar[Mapping[str, Constant]] = {}

    def __init__(self, **values: TensorLike) -> None:
        """Store one value [in the constant's unit] for each declared constant.

        Raises:
            InputError: a value is not finite, or negative where it must not be.
        """
        super().__init__()
        for name, constant in self.constants.items():
            self._store(name, _tensor(values[name]), constant)

    def _store(self, name: str, value: Tensor, constant: Constant) -> None:
        known = value.detach()
        if not bool(torch.isfinite(known).all()):
            raise InputError(
                f"{name} of {type(self).__name__} is not finite: give finite values [{constant.unit}]"
            )
        if constant.positive and bool((known < 0).any()):
            raise InputError(
                f"{name} of {type(self).__name__} is negative: give values >= 0 [{constant.unit}]"
            )
        if value.requires_grad:
            setattr(self, name, value)
        elif constant.positive:
            self.register_parameter(f"log_{name}", nn.Parameter(known.log(), requires_grad=False))
        else:
            self.register_parameter(name, nn.Parameter(known.clone(), requires_grad=False))

    def with_values(self: Own, **values: TensorLike) -> Own:
        """The same with other values [in the constants' units] of some constants; all else is shared.

        Raises:
            InputError: a constant that there is not, or a value that it cannot have.
        """
        other = type(self).__new__(type(self))
        other.__dict__.update(self.__dict__)  # torch would copy modules within, too
        other._parameters = dict(self._parameters)
        for name, value in values.items():
            if name not in self.constants:
                known = ", ".join(self.constants) or "none"
                raise InputError(f"{type(self).__name__} has no constant {name!r}: it has {known}")
            for stored in (name, f"log_{name}"):
                other._parameters.pop(stored, None)
                other.__dict__.pop(stored, None)
            other._store(name, _tensor(value), self.constants[name])
        return other

    def own_size(self, over: str) -> int | None:
        """How many values a constant over `over` has, where that is for the module itself to say."""
        return None

    def value(self, name: str) -> Tensor:
        """The constant `name` in its unit, on the graph of whatever it depends on."""
        stored = getattr(self, f"log_{name}", None)
        if isinstance(stored, Tensor):
            return stored.exp()
        value = getattr(self, name)
        assert isinstance(value, Tensor)
        return value

    def values(self, like: Tensor) -> dict[str, Tensor]:
        """All constants, with the data type and device of `like`."""
        return {name: self.value(name).to(dtype=like.dtype, device=like.device) for name in self.constants}


def _tensor(value: TensorLike) -> Tensor:
    """Keep tensors with gradients; all else becomes float64, so that its logarithm loses no digit."""
    if isinstance(value, Tensor):
        return value if value.requires_grad else value.to(torch.float64)
    return torch.from_numpy(np.array(value, dtype=np.float64))


def broadcast(*shapes: tuple[int, ...]) -> torch.Size:
    """The shape that tensors of these shapes take together."""
    return torch.Size(np.broadcast_shapes(*shapes))
