"""A cantilever in closed form: what a beam that is held straight and let go does, by other laws than ours."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from model.types import Array, Observation

GRAVITY = 9.81
MODE = 1.8751
"""The first root of cos β cosh β = -1."""
RATE = 100.0
"""Frames per second."""
MARKERS = np.array([[0.0, 0.0, 0.03], [0.0, -0.005, 0.012], [0.0, 0.032, 0.008]])
CLAMP = np.array([[0.0, -0.002, 0.003], [0.0, 0.03, 0.03], [0.0, 0.032, 0.001]])
"""Three markers at the tip, and three at the clamp [m], about where those of the recordings are."""


@dataclass(frozen=True)
class Cantilever:
    """A uniform square beam along x, clamped at -length, its free end at 0, maybe with a load there.

    Reference:
        Rayleigh (1877), The theory of sound, chapter 8 (the first mode of a bar that is clamped at one end,
        and a load at the other).
    """

    length: float = 0.1
    """[m]."""
    side: float = 0.03
    """[m]."""
    density: float = 1070.0
    """[kg/m³]."""
    modulus: float = 264e3
    """Young's [Pa]."""
    load: float = 0.0
    """At the tip [kg]."""
    damping: float = 0.05
    """Of critical."""

    @property
    def mass(self) -> float:
        """Without the load [kg]."""
        return self.density * self.length * self.side**2

    @property
    def drop(self) -> float:
        """Of the tip at rest [m]: w L⁴ / 8 E I of its own weight, P L³ / 3 E I of the load."""
        weight = GRAVITY * (self.mass / 8.0 + self.load / 3.0)
        return weight * self.length**3 / self._rigidity

    @property
    def period(self) -> float:
        """Of the first mode [s]."""
        # of the beam counts what gives the first mode its frequency without a load, 0.2427
        moving = 3.0 / MODE**4 * self.mass + self.load
        stiffness = 3.0 * self._rigidity / self.length**3
        return float(2.0 * np.pi * np.sqrt(moving / stiffness))

    @property
    def _rigidity(self) -> float:
        """E I [N m²]."""
        return self.modulus * self.side**4 / 12.0

    def recording(self, seconds: float, held: float = 0.0) -> Observation:
        """Markers of the beam that is let go after it was held straight.

        Args:
            seconds: After it is let go.
            held: Seconds before.
        """
        times = np.arange(round((held + seconds) * RATE)) / RATE
        down = self._fallen(np.maximum(times - held, 0.0))
        points = np.repeat(MARKERS[None], len(times), 0)
        points[..., 2] -= down[:, None]
        # the end is turned as the first mode says, 1.3765 over the length for a drop of one
        points[..., 0] += 1.3765 * down[:, None] / self.length * (MARKERS[:, 2] - self.side / 2)
        clamp = np.repeat((CLAMP - [self.length, 0.0, 0.0])[None], len(times), 0)
        return Observation(times, points.astype(np.float32), clamp.astype(np.float32))

    def _fallen(self, times: Float64[Array, " T"]) -> Float64[Array, " T"]:
        """How far the tip is below where it was held [m]."""
        omega = 2.0 * np.pi / self.period
        swing = omega * np.sqrt(1.0 - self.damping**2)
        phase = np.cos(swing * times) + self.damping * omega / swing * np.sin(swing * times)
        fallen: Float64[Array, " T"] = self.drop * (1.0 - np.exp(-self.damping * omega * times) * phase)
        return fallen
