"""What was played, as a video."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float32, UInt8

from model.backdrops import shade, studio
from model.formats.movie import encode_mp4
from model.playground.actor import Actor
from model.playground.colors import ColorBy, Colors
from model.playground.moment import Moment
from model.rendering.base import Renderer
from model.skinning import Skin
from model.types import Array, Camera

LONGEST = 60.0
"""A recording ends after so many seconds of simulated time."""


@dataclass(frozen=True)
class Shot:
    """One frame of a recording."""

    moment: Moment
    by: ColorBy


class Recording:
    """Keeps the frames that pass while it is on; later it draws them, so that none is missing."""

    def __init__(self, interval: float) -> None:
        """For frames of `interval` [s]."""
        self._interval = interval
        self._shots: list[Shot] = []
        self.on = False

    def __len__(self) -> int:
        """Frames kept."""
        return len(self._shots)

    @property
    def seconds(self) -> float:
        """Simulated time that was recorded [s]."""
        return len(self._shots) * self._interval

    def start(self) -> None:
        """Begin anew."""
        self._shots, self.on = [], True

    def stop(self) -> list[Shot]:
        """End; the frames that were kept, which are forgotten."""
        shots, self._shots, self.on = self._shots, [], False
        return shots

    def see(self, moment: Moment, by: ColorBy) -> None:
        """Keep a frame, if it is on and the frame is new."""
        if self.on and (not self._shots or self._shots[-1].moment.frame != moment.frame):
            self._shots.append(Shot(moment, by))
            self.on = self.seconds < LONGEST


def draw(
    shots: Sequence[Shot],
    interval: float,
    actors: Sequence[Actor],
    colors: Colors,
    camera: Camera,
    renderer: Renderer,
) -> bytes:
    """An MP4 of a recording, all actors on one stage.

    Args:
        shots: At least one.
        interval: Between them [s].
        actors: In the order of the points of each shot.
        colors: Of the Gaussians.
        camera: Where it is seen from.
        renderer: What draws it.
    """
    times = np.arange(len(shots)) * interval
    return encode_mp4(_pictures(shots, actors, colors, camera, renderer), times)


def _pictures(
    shots: Sequence[Shot], actors: Sequence[Actor], colors: Colors, camera: Camera, renderer: Renderer
) -> Iterator[UInt8[Array, "H W 3"]]:
    skins = [Skin(actor.bundle.gaussians, actor.bundle.topology) for actor in actors]
    gaussians = actors[0].bundle.gaussians
    scales = torch.as_tensor(gaussians.scales).repeat(len(actors), 1)
    opacities = torch.as_tensor(gaussians.opacities).repeat(len(actors))
    volumes = np.tile(gaussians.volumes, len(actors))
    for shot in shots:
        settings = shot.moment.settings
        ground = settings.ground_height if settings.ground else None
        with torch.no_grad():
            seen = [skin(torch.as_tensor(p)) for skin, p in zip(skins, shot.moment.points, strict=True)]
            means = torch.cat(
                [m + torch.as_tensor(a.shift).to(m) for (m, _), a in zip(seen, actors, strict=True)]
            )
            shades = np.concatenate([colors(shot.by, settings, points) for points in shot.moment.points])
            turns = torch.cat([q for _, q in seen])
            image = renderer(means, scales, turns, opacities, torch.from_numpy(shades), camera)
        behind: Float32[Array, "H W 3"] = studio(camera, ground)
        if ground is not None:
            behind = shade(behind, means.numpy(), volumes, ground, camera)
        picture = image.color.numpy() + (1 - image.alpha.numpy())[..., None] * behind
        yield (picture.clip(0, 1) * 255 + 0.5).astype(np.uint8)
