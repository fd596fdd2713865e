"""One object in one interaction, as a predictor is trained and judged on it."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from jaxtyping import Float32, Float64, Int, Int32

from model.errors import InputError
from model.types import Array, Camera, Gaussians, MaterialPrior, Observation, ShapeClass, Topology

ObjectClass: TypeAlias = Literal["plush", "cloth", "rope", "foam", "bag", "mixed", "unknown"]
Interaction: TypeAlias = Literal["lift", "double_lift", "push", "stretch", "fold", "drop", "shake", "unknown"]


@dataclass(frozen=True)
class Truth:
    """What a generated object really is: for supervision and for measuring, never for a prediction."""

    material: Int[Array, " K"]
    """Of each part, an index into `model.priors.materials.MATERIALS`."""
    modulus: Float64[Array, " K"]
    """Young's modulus of each part [Pa], such that `lattice_stiffness` of it is the twin's best stiffness."""
    dashpot_damping: float
    """[N·s/m], of every spring of the twin."""
    drag_rate: float
    """[1/s], mean over the mass."""
    friction: float
    """[1], mean over the parts, by their volume."""
    restitution: float
    """[1], mean over the parts, by their volume."""


@dataclass(frozen=True)
class Anchors:
    """Which mass points each observed point hangs on, and how much: y = Σ weight x; rows sum to 1."""

    index: Int32[Array, "N k"]
    weight: Float32[Array, "N k"]


@dataclass(frozen=True)
class Case:
    """One object in one interaction.

    Cases of one `object_name` share the points, the springs and the parts of their topology (in the same
    order, up to a rigid motion), so that parameters per spring can be carried from one interaction
    to another; what holds the object, and where it is seen, differ.
    """

    name: str
    object_name: str
    object_class: ObjectClass
    interaction: Interaction
    shape_class: ShapeClass
    topology: Topology
    """The twin's: frame 0 is its rest state. Its bindings are those of `gaussians` (0 rows without)."""
    priors: tuple[MaterialPrior, ...]
    """One per part: what a material expert says."""
    observation: Observation
    """What was seen; frame 0 is the first. Its controllers are those of the topology."""
    rest: Float32[Array, "N 3"]
    """Where the observed points are in frame 0, seen or not [m]."""
    anchors: Anchors
    split: int
    """Frames [0, split) may be learned from, the rest is the future."""
    camera: Camera | None = None
    """The only view, where there is one: motion along its lines of sight is then not measured but guessed.
    None: points were measured in space."""
    gaussians: Gaussians | None = None
    """Its looks."""
    complete: Float32[Array, "T N 3"] | None = None
    """Where the observed points really were, without noise and gaps [m]: for measuring alone."""
    truth: Truth | None = None

    def __post_init__(self) -> None:
        """Check what the rest of the product relies on.

        Raises:
            InputError: priors, anchors, controllers or the split do not fit.
        """
        parts = int(self.topology.part.max()) + 1
        frames, seen = self.observation.points.shape[:2]
        if len(self.priors) < parts:
            raise InputError(f"case {self.name}: {parts} parts but {len(self.priors)} priors")
        if len(self.rest) != seen or len(self.anchors.index) != seen:
            raise InputError(
                f"case {self.name}: {seen} observed points, but {len(self.anchors.index)} anchors"
            )
        if self.observation.controllers.shape[1] != len(self.topology.controller_points):
            raise InputError(f"case {self.name}: the observation has other controllers than the topology")
        if not 2 <= self.split <= frames:
            raise InputError(
                f"case {self.name}: split {self.split} of {frames} frames: expected 2 to {frames}"
            )
