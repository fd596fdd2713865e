"""By what the twin is coloured."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
from jaxtyping import Float, Float32, Float64
from matplotlib import colormaps

from model.bundle import TwinBundle
from model.playground.edit import scaled_stiffness
from model.playground.look import on_gaussians
from model.playground.settings import Settings, part_count
from model.priors.materials import MATERIALS
from model.types import Array

ColorBy: TypeAlias = Literal["appearance", "part", "material", "stiffness", "strain", "gap", "effect"]
"""`gap`: a report's share of the gap at each point; `effect`: how strongly its verdict acts there."""
STRAINED = 0.2
"""The strain at which the scale ends."""
UNKNOWN = (0.6, 0.6, 0.6)

Legend: TypeAlias = tuple[tuple[str, tuple[float, float, float]], ...]
"""Words and the colours that stand for them."""


@dataclass(frozen=True)
class Where:
    """What a gap report says of each point of a twin."""

    gap: Float64[Array, " N"]
    """Share of the gap, the largest being 1."""
    effect: Float64[Array, " N"]
    """How strongly the verdict's effect acts, 0..1."""


class Colors:
    """Colours of the Gaussians of a twin.

    Args:
        bundle: The twin as it came. May be set to the same twin of other materials.
        where: What a gap report says of its points.
    """

    def __init__(self, bundle: TwinBundle, where: Where | None = None) -> None:
        """See the class."""
        self.bundle, self._where = bundle, where
        self._makers: Mapping[ColorBy, Callable[[Settings, Array], Float[Array, "N 3"]]] = {
            "part": lambda settings, points: _palette(part_count(self.bundle))[self.bundle.topology.part],
            "material": lambda settings, points: self._materials()[self.bundle.topology.part],
            "stiffness": lambda settings, points: self._stiffness(settings),
            "strain": lambda settings, points: _scale(strain(self.bundle, points) / STRAINED),
            "gap": lambda settings, points: _scale(self._reported().gap),
            "effect": lambda settings, points: _scale(self._reported().effect),
        }

    @property
    def choices(self) -> tuple[ColorBy, ...]:
        """What this twin can be coloured by."""
        return tuple(
            name for name in get_args(ColorBy) if self._where is not None or name not in ("gap", "effect")
        )

    def __call__(
        self, by: ColorBy, settings: Settings, points: Float32[Array, "N 3"]
    ) -> Float32[Array, "G 3"]:
        """RGB, 0..1, with the points at `points` [m]."""
        if by == "appearance":
            return self.bundle.gaussians.visible_colors
        return on_gaussians(self.bundle, self._makers[by](settings, points).astype(np.float32))

    def legend(self, by: ColorBy, settings: Settings) -> Legend:
        """What the colours mean; empty where they speak for themselves."""
        parts = self.bundle.parts
        if by == "appearance":
            return ()
        if by == "part":
            names = [str(part.label) for part in parts] or [
                f"part {i}" for i in range(part_count(self.bundle))
            ]
            return tuple(zip(names, map(_rgb, _palette(len(names))), strict=True))
        if by == "material":
            found = dict.fromkeys(material_of(self.bundle, part) for part in range(part_count(self.bundle)))
            return tuple((name or "not known", _material_color(name)) for name in found)
        low, high = {
            "stiffness": [f"{value:.3g} N/m" for value in self._range(settings)],
            "strain": ["strain 0 %", f"{STRAINED:.0%} and more"],
            "gap": ["no share of the gap", "the largest share"],
            "effect": ["the effect does not act", "it acts fully"],
        }[by]
        ends = _scale(np.array([0.0, 1.0]))
        return ((low, _rgb(ends[0])), (high, _rgb(ends[1])))

    def _materials(self) -> Float[Array, "K 3"]:
        count = part_count(self.bundle)
        return np.array([_material_color(material_of(self.bundle, part)) for part in range(count)])

    def _stiffness(self, settings: Settings) -> Float[Array, "N 3"]:
        stiffness = np.log(scaled_stiffness(self.bundle, settings.stiffness).astype(np.float64))
        low, high = np.log(self._range(settings))
        return _scale((on_points(self.bundle, stiffness) - low) / max(high - low, 1e-9))

    def _range(self, settings: Settings) -> tuple[float, float]:
        """The stiffness [N/m] at both ends of the scale."""
        stiffness = scaled_stiffness(self.bundle, settings.stiffness)
        low, high = np.quantile(stiffness, (0.02, 0.98)) if len(stiffness) else (1.0, 1.0)
        return float(low), float(high)

    def _reported(self) -> Where:
        assert self._where is not None
        return self._where


def strain(bundle: TwinBundle, points: Float32[Array, "N 3"]) -> Float64[Array, " N"]:
    """How much the springs of each point are longer or shorter than at rest, on average [1]."""
    ends = points[bundle.topology.springs].astype(np.float64)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    return on_points(bundle, np.abs(length / bundle.topology.rest_length - 1.0))


def on_points(bundle: TwinBundle, values: Float64[Array, " E"]) -> Float64[Array, " N"]:
    """The mean over the springs of each point; 0 where it has none."""
    springs, count = bundle.topology.springs.ravel(), len(bundle.topology.points)
    total = np.bincount(springs, weights=np.repeat(values, 2), minlength=count)
    mean: Float64[Array, " N"] = total / np.maximum(np.bincount(springs, minlength=count), 1)
    return mean


def material_of(bundle: TwinBundle, part: int) -> str | None:
    """The most probable material of a part, if any is known."""
    believed = bundle.parts[part].materials if part < len(bundle.parts) else {}
    return max(believed, key=lambda name: believed[name]) if believed else None


def _material_color(name: str | None) -> tuple[float, float, float]:
    return UNKNOWN if name not in MATERIALS else _rgb(_palette(len(MATERIALS))[MATERIALS.index(name)])


def _palette(count: int) -> Float64[Array, "k 3"]:
    """Colours that are told apart easily; they repeat after twenty."""
    wheel = np.array(colormaps["tab20"].colors, np.float64)  # type: ignore[attr-defined]
    wheel = np.concatenate([wheel[::2], wheel[1::2]])
    chosen: Float64[Array, "k 3"] = wheel[np.arange(count) % len(wheel)]
    return chosen


def _scale(values: Float[Array, " n"]) -> Float64[Array, "n 3"]:
    """From dark to bright for 0..1."""
    colors: Float64[Array, "n 3"] = np.asarray(colormaps["inferno"](0.08 + 0.87 * np.clip(values, 0, 1)))[
        :, :3
    ]
    return colors


def _rgb(color: Float[Array, " 3"]) -> tuple[float, float, float]:
    red, green, blue = (float(part) for part in color)
    return red, green, blue
