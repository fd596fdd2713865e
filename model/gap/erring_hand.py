"""Hands that are elsewhere than measured, and hold the body elsewhere than their controllers are."""

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from jaxtyping import Float, Float64
from torch import Tensor

from model.gap.bodies.hold import Hold
from model.gap.effects.base import Quantity
from model.types import Array

HAND = "hand_"
"""How quantities begin that say by how much a hand is elsewhere than it was measured to be."""
MOST_HANDS = 2
"""Of more, none is taken to be elsewhere."""
ELSEWHERE = 0.01
"""A hand is at most so far from where it was measured to be, along each axis [m]."""
HOLD = "hold_"
"""How quantities begin that say by how much a hand holds the body elsewhere than its controllers are."""
ASIDE = 0.75
"""Grasps: it holds at most so far from them, along each axis."""
ERRING, BESIDE = 0.003, 0.375
"""How far a hand usually is from where it was measured to be [m], and from where it holds the body [grasps],
along each axis."""
EASED = 0.15
"""Time in which it comes to be there [s]: the first frame is at rest."""


@dataclass(frozen=True)
class ErringHands:
    """Of a body that is held; of one whose grip is known none errs."""

    hold: Hold | None
    """The points within each hand; None: nothing is held, or which points are is known."""

    def quantities(self, grasp: float) -> dict[str, Quantity]:
        """Hand by hand along each axis [m], where it is and then where it holds; it reaches a `grasp` far."""
        away = Quantity("m", (-ELSEWHERE, ELSEWHERE), 0.0, spread=ERRING)
        aside = Quantity("m", (-ASIDE * grasp, ASIDE * grasp), 0.0, spread=BESIDE * grasp)
        return dict.fromkeys(self._names(HAND), away) | dict.fromkeys(self._names(HOLD), aside)

    def aside(self, values: Mapping[str, Tensor]) -> Float[Tensor, "*b n 3"] | None:
        """How far on the body each hand is from its controllers [m]; None: no hand errs."""
        return self._of(HOLD, values)

    def displaced(
        self, controls: Float[Tensor, "T H 3"], values: Mapping[str, Tensor], times: Float64[Array, " T"]
    ) -> Float[Tensor, "T *b H 3"]:
        """Where the points within hands are carried, each hand where it is, not where it was measured."""
        away = self._of(HAND, values)
        if away is None or self.hold is None:
            return controls
        away, batch = away.to(controls), away.shape[:-2]
        passed = torch.from_numpy(times - times[0]).to(controls)
        eased = (passed / EASED).clamp(max=1.0).reshape(-1, *[1] * (away.ndim))
        still = controls.reshape(len(controls), *[1] * len(batch), -1, 3)
        return still + eased * away[..., self.hold.hands, :]

    def _names(self, of: str) -> list[str]:
        """Quantities whose names begin like this, hand by hand, x, y and z."""
        count = 0 if self.hold is None else int(self.hold.hands.max(initial=-1)) + 1
        hands = range(1, count + 1) if count <= MOST_HANDS else ()
        return [f"{of}{hand}_{axis}" for hand in hands for axis in "xyz"]

    def _of(self, of: str, values: Mapping[str, Tensor]) -> Float[Tensor, "*b n 3"] | None:
        """These quantities of all hands [m]; None: there are none."""
        names = self._names(of)
        if not names:
            return None
        batch = values[names[0]].shape[:-1]
        return torch.stack([values[name] for name in names], -1).reshape(*batch, -1, 3)
