"""How something moved → features: the seam every motion encoder fills."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from jaxtyping import Float32, Float64, Int, UInt8
from torch import nn

from model.types import Array, Camera

GLOBALS = ("dashpot_damping", "drag_rate", "friction", "restitution")
"""What twins of reference are varied in beside the modulus of each part, in this order."""


@dataclass(frozen=True)
class ReferenceMotion:
    """How the observed points would have moved if the body were made of known stuff.

    V constants are varied one at a time: the modulus of each of the K parts, then `GLOBALS`.
    """

    sweep_log_modulus: Float64[Array, " R"]
    """Of twins of one modulus throughout: ln of the specific modulus E/ρ [m²/s²], ascending."""
    sweep: Float32[Array, "R T N 3"]
    """How they move [m]."""
    base_log_modulus: Float64[Array, " K"]
    """Of the parts of a twin that moves much like what was seen: ln E/ρ [m²/s²]."""
    base: Float32[Array, "T N 3"]
    """How it moves [m]."""
    base_globals: Float64[Array, " 4"]
    """Its constants: ln of dashpot [N·s/m], drag rate [1/s] and friction, logit of restitution."""
    varied: Float32[Array, "V T N 3"]
    """The base with one constant changed [m]."""
    steps: Float64[Array, " V"]
    """By how much: in ln, restitution in its logit; 0: the constant does not act here."""


@dataclass(frozen=True)
class MotionClip:
    """What a motion encoder is given of one clip: what was seen, and what its kind asks for beside it."""

    times: Float64[Array, " T"]
    """[s]."""
    rest: Float32[Array, "N 3"]
    """Where the observed points are in frame 0 [m]."""
    points: Float32[Array, "T N 3"]
    """Where they were seen [m]; NaN where they were not."""
    part: Int[Array, " N"]
    """On which part each lies."""
    parts: int
    """K."""
    controllers: Float32[Array, "T C 3"]
    """[m]; C = 0: nothing is held."""
    gravity: tuple[float, float, float]
    """[m/s²]."""
    camera: Camera | None = None
    """The only view, if there was one: depth along its lines of sight was guessed. Also that of `images`."""
    references: ReferenceMotion | None = None
    """For encoders with `needs_references`."""
    images: UInt8[Array, "T H W 3"] | None = None
    """For encoders with `needs_images`: RGB, as the camera says."""


@dataclass(frozen=True)
class EncodedMotion:
    """Features of what moved; all finite and of order 1."""

    points: Float32[Array, "N Dn"]
    """Per observed point."""
    parts: Float32[Array, "K Dk"]
    """Per part; Dn + Dk is the encoder's `dim`."""
    whole: Float32[Array, " Dg"]
    """Of the clip; Dg is the encoder's `global_dim`."""


class EncoderIdentity(NamedTuple):
    """Which encoder made features: those of another one mean something else."""

    name: str
    version: str
    weights: str | None
    """sha256 of its own weights, if it has any."""

    def __str__(self) -> str:
        """As messages say it."""
        return f"{self.name} {self.version}" + (f" ({self.weights[:12]})" if self.weights else "")


class MotionEncoder(nn.Module, ABC):
    """Frozen: describes motion, learns nothing."""

    name: ClassVar[str]
    version: ClassVar[str]
    needs_references: ClassVar[bool] = False
    needs_images: ClassVar[bool] = False
    weights: str | None = None
    dim: int
    """Features per point, those of its part included."""
    global_dim: int
    """Features per clip."""

    @property
    def identity(self) -> EncoderIdentity:
        """Which one it is."""
        return EncoderIdentity(self.name, self.version, self.weights)

    @abstractmethod
    def forward(self, clip: MotionClip) -> EncodedMotion:
        """Describe a clip.

        Raises:
            InputError: the clip lacks what this encoder needs.
        """
