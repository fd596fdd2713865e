"""What flows between the stages: frozen records with documented shapes.

Symbols in shapes: T frames, H×W pixels, N points, G Gaussians, E springs, C controller points,
S controller springs, K parts. World frame: metres, seconds, kilograms, z up. Images are RGB,
pixel coordinates are (x right, y down) with the centre of the first pixel at (0, 0).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int, Int32, UInt8

ShapeClass: TypeAlias = Literal["sheet", "rope", "solid"]
Array: TypeAlias = np.ndarray

STANDARD_GRAVITY = (0.0, 0.0, -9.81)


@dataclass(frozen=True)
class Frames:
    """A decoded clip."""

    images: UInt8[Array, "T H W 3"]
    times: Float64[Array, " T"]
    """Presentation times [s], strictly increasing, the first is 0."""
    name: str
    sha256: str
    """Of the file's bytes, hexadecimal."""
    warnings: tuple[str, ...] = ()
    source_size: tuple[int, int] | None = None
    """Width, height of the clip as the user sees it [px], if `images` were made smaller; None: the same."""
    numbers: Int[Array, " T"] | None = None
    """Place of each of `images` among all frames of the clip, if some were left out; None: the same."""
    clip_frames: int | None = None
    """Frames of the whole clip, if some were left out; None: as many as `images`."""

    def number(self, index: int) -> int:
        """Place among all frames of the clip, as the user counts them, of one of `images`."""
        return index if self.numbers is None else int(self.numbers[index])

    def index(self, number: int) -> int:
        """Which of `images` is nearest to a frame of the clip."""
        return number if self.numbers is None else int(np.abs(self.numbers - number).argmin())

    @property
    def length(self) -> int:
        """Frames of the whole clip, with those that were left out."""
        return len(self.images) if self.clip_frames is None else self.clip_frames

    @property
    def scale(self) -> float:
        """Pixels of `images` per pixel of the clip."""
        return 1.0 if self.source_size is None else self.images.shape[2] / self.source_size[0]

    @property
    def fps(self) -> float:
        """Mean frame rate [1/s]."""
        return float((len(self.times) - 1) / (self.times[-1] - self.times[0]))


@dataclass(frozen=True)
class Prompt:
    """What the user says about the object on the keyframe; all of it optional."""

    mask: Bool[Array, "H W"] | None = None
    box: tuple[int, int, int, int] | None = None
    """x, y, width, height [px]."""
    keyframe: int | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Masks:
    """Where the object and the hand are, in every frame; the two never overlap."""

    object: Bool[Array, "T H W"]
    hand: Bool[Array, "T H W"]
    keyframe: int
    """The frame the twin is reconstructed from; its replay starts there."""
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Tracks:
    """2D tracks through all frames, all of them starting on the keyframe."""

    points: Float32[Array, "T N 2"]
    visible: Bool[Array, "T N"]
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Camera:
    """A pinhole camera: OpenCV axes (x right, y down, z forward)."""

    intrinsics: Float64[Array, "3 3"]
    """K [px]."""
    world_from_camera: Float64[Array, "4 4"]
    """Pose: maps camera coordinates to world coordinates [m]."""
    width: int
    height: int

    def to_camera(self, points: Float[Array, "*n 3"]) -> Float64[Array, "*n 3"]:
        """World points [m] in camera coordinates [m]."""
        rotation, position = self.world_from_camera[:3, :3], self.world_from_camera[:3, 3]
        local: Float64[Array, "*n 3"] = (np.asarray(points, np.float64) - position) @ rotation
        return local

    def to_world(self, points: Float[Array, "*n 3"]) -> Float64[Array, "*n 3"]:
        """Camera points [m] in world coordinates [m]."""
        rotation, position = self.world_from_camera[:3, :3], self.world_from_camera[:3, 3]
        world: Float64[Array, "*n 3"] = np.asarray(points, np.float64) @ rotation.T + position
        return world

    def project(self, points: Float[Array, "*n 3"]) -> tuple[Float64[Array, "*n 2"], Float64[Array, "*n"]]:
        """Pixel coordinates [px] and depth along the optical axis [m] of world points [m]."""
        local = self.to_camera(points)
        depth = local[..., 2]
        safe = np.where(np.abs(depth) < 1e-9, 1e-9, depth)
        homogeneous = local @ self.intrinsics.T
        return homogeneous[..., :2] / safe[..., None], depth

    def unproject(self, pixels: Float[Array, "*n 2"], depth: Float[Array, "*n"]) -> Float64[Array, "*n 3"]:
        """World points [m] seen at `pixels` [px] at `depth` [m] along the optical axis."""
        pixels = np.asarray(pixels, np.float64)
        homogeneous = np.concatenate([pixels, np.ones_like(pixels[..., :1])], axis=-1)
        rays = homogeneous @ np.linalg.inv(self.intrinsics).T
        return self.to_world(rays * np.asarray(depth, np.float64)[..., None])

    @property
    def position(self) -> Float64[Array, " 3"]:
        """Optical centre in the world [m]."""
        return self.world_from_camera[:3, 3]

    @property
    def forward(self) -> Float64[Array, " 3"]:
        """Unit vector of the optical axis in the world."""
        return self.world_from_camera[:3, 2]


@dataclass(frozen=True)
class Calibration:
    """How the image relates to the metric, upright world, and how each part of that was fixed."""

    camera: Camera
    gravity: tuple[float, float, float]
    """[m/s²]; the world is upright, so this is (0, 0, -9.81) unless a camera file says otherwise."""
    ground_height: float | None
    """z of the ground plane [m]; None: the object rests on nothing we can see."""
    scale_source: str
    """One sentence for the manifest: how metres were fixed."""
    camera_source: str
    """How intrinsics and pose (so the direction of gravity) were fixed."""
    ground_source: str
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Gaussians:
    """3D Gaussians that fill the volume of the object."""

    means: Float32[Array, "G 3"]
    """Centres [m]."""
    scales: Float32[Array, "G 3"]
    """Standard deviations along the local axes [m]."""
    quaternions: Float32[Array, "G 4"]
    """Rotation local → world, unit, w x y z."""
    opacities: Float32[Array, " G"]
    """In (0, 1)."""
    colors: Float32[Array, "G 3"]
    """RGB of the direction-independent term; 0..1, but beyond that where the file of another program goes."""
    volumes: Float32[Array, " G"]
    """Volume of the object that each Gaussian stands for [m³]; their sum is the object's."""
    harmonics: Float32[Array, "G R"] | None = None
    """Higher spherical-harmonic coefficients in the order of a 3DGS file (`f_rest_*`), if any."""
    warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        """The number of Gaussians."""
        return len(self.means)

    @property
    def visible_colors(self) -> Float32[Array, "G 3"]:
        """`colors` as they can be drawn, 0..1."""
        visible: Float32[Array, "G 3"] = self.colors.clip(0.0, 1.0)
        return visible


@dataclass(frozen=True)
class Features:
    """Semantic features on Gaussians."""

    values: Float32[Array, "G D"]
    origin: Int[Array, " G"]
    """SEEN, SYMMETRY or NEIGHBOURHOOD: where each row comes from."""
    warnings: tuple[str, ...] = ()

    SEEN = 0
    SYMMETRY = 1
    NEIGHBOURHOOD = 2


@dataclass(frozen=True)
class Parts:
    """A connected partition of the Gaussians."""

    labels: Int32[Array, " G"]
    """0 … count-1."""
    count: int
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Controllers:
    """Where the hand holds the object, and how it moves from the keyframe on."""

    motion: Float32[Array, "T C 3"]
    """[m]; frame 0 is the keyframe. C = 0: no hand was found."""
    group: Int[Array, " C"]
    """Which hand (connected contact) each point belongs to."""
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Estimate:
    """A log-normal belief about one positive quantity."""

    mean: float
    """exp of the mean of the logarithm (the median), in `unit`."""
    spread: float
    """Standard deviation of the natural logarithm."""
    unit: str


@dataclass(frozen=True)
class PartView:
    """What a prior gets to see of one part (or of the whole object)."""

    image: UInt8[Array, "H W 3"]
    """The keyframe."""
    mask: Bool[Array, "H W"]
    """The part's visible pixels."""
    object_mask: Bool[Array, "H W"]
    label: str
    """`object` for the whole, else `part 0`, `part 1`, …"""
    shape_class: ShapeClass | None = None
    """What is already known of the whole, from the user or from the first look."""


@dataclass(frozen=True)
class MaterialPrior:
    """What a material expert believes about one part."""

    distribution: Float64[Array, "10"]
    """Over `model.priors.materials.MATERIALS`; sums to 1."""
    properties: Mapping[str, Estimate]
    """`stiffness` (Young's modulus) [Pa], `damping` (ratio) [1], `drag_rate` [1/s], `friction` [1],
    `restitution` [1], `density` [kg/m³]."""
    shape_class: ShapeClass
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Topology:
    """Mass points, the springs between them, and what hangs on them."""

    points: Float32[Array, "N 3"]
    """Rest positions [m]."""
    mass: Float32[Array, " N"]
    """[kg]."""
    springs: Int32[Array, "E 2"]
    rest_length: Float32[Array, " E"]
    """[m]."""
    part: Int32[Array, " N"]
    binding_index: Int32[Array, "G k"]
    """The points each Gaussian follows."""
    binding_weight: Float32[Array, "G k"]
    """Rows sum to 1."""
    controller_points: Float32[Array, "C 3"]
    """Where the controllers are at rest [m]."""
    controller_springs: Int32[Array, "S 2"]
    """(controller, point)."""
    controller_rest_length: Float32[Array, " S"]
    """[m]."""
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Parameter:
    """One global physical parameter."""

    value: float | tuple[float, ...]
    unit: str
    source: str
    """`predicted`, `prior`, `fitted` or `user`."""
    std: float | None = None


@dataclass(frozen=True)
class Parameters:
    """The mechanics of a topology: what a predictor predicts."""

    stiffness: Float32[Array, " E"]
    """[N/m]."""
    controller_stiffness: Float32[Array, " S"]
    """[N/m]."""
    globals: Mapping[str, Parameter]
    """`dashpot_damping` [N*s/m], `drag_rate` [1/s], `friction` [1], `restitution` [1],
    `collision_distance` [m], `bending_decay` [1/s], `gravity` [m/s²], `ground_height` [m] (absent: no
    ground)."""
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Trajectory:
    """Points over time; frame 0 is the rest state."""

    times: Float64[Array, " T"]
    """[s]."""
    points: Float32[Array, "T N 3"]
    """[m]."""
    metadata: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Observation:
    """What really moved (contract 3)."""

    times: Float64[Array, " T"]
    points: Float32[Array, "T N 3"]
    """NaN where not seen."""
    controllers: Float32[Array, "T C 3"]
    ground_height: float | None = None
    gravity: tuple[float, float, float] = STANDARD_GRAVITY
    colors: UInt8[Array, "N 3"] | None = None
    parts: Int[Array, " N"] | None = None
