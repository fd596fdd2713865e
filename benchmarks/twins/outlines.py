"""Where the object is in a clip, and where twins of it are, as outlines at four moments.

    matphys twin CLIP --out ours.twin.zip
    matphys twin CLIP --out prior.twin.zip --predictor prior-mean
    python benchmarks/twins/outlines.py CLIP PICTURE.png "predicted=ours.twin.zip" "prior mean=prior.twin.zip"

Outlines alone: clips of people are no pictures to hand on. Prints the mean silhouette IoU of each twin with
the masks, the number that the manifest has too.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Bool
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from model.bundle import TwinBundle
from model.errors import InputError
from model.formats.files import replacing
from model.gap.report.style import EFFECT, MUTED, OBSERVED, REFIT, SMALL, new_figure, png
from model.preview import PANEL, SOLID, frame_overlap, matched_frames, render_rollout
from model.prompt import read_prompt
from model.registry import by_name
from model.rendering import best_renderer
from model.segmentation import ALL_SEGMENTERS
from model.types import Array, Frames, Masks
from model.video import read_video
from model.views import scaled

MOMENTS = 4
COLORS = (REFIT, EFFECT)
Seen = list[tuple[int, Bool[Array, "h w"]]]


def silhouettes(twin: TwinBundle, frames: Frames, masks: Masks) -> tuple[Seen, float]:
    """By frame of the clip: where the twin is drawn. And the mean overlap with the masks."""
    if twin.camera is None:
        raise InputError("a twin that knows no camera: make it of the clip with `matphys twin`")
    camera, trajectory = scaled(twin.camera, PANEL), twin.rollout()
    clip_frames, moments = matched_frames(frames.times, masks.keyframe, trajectory.times)
    drawn = render_rollout(twin.gaussians, twin.topology, trajectory.points[moments], camera, best_renderer())
    pairs = [(int(frame), picture.alpha) for frame, picture in zip(clip_frames, drawn, strict=True)]
    overlap = [frame_overlap(alpha, masks, frame, camera) for frame, alpha in pairs]
    return [(frame, alpha > SOLID) for frame, alpha in pairs], float(np.mean(overlap))


def compared(title: str, masks: Masks, seen: dict[str, tuple[Seen, float]]) -> Figure:
    """The picture."""
    figure = new_figure(2.2)
    first = next(iter(seen.values()))[0]
    places = np.linspace(0, len(first) - 1, MOMENTS + 1).round().astype(int)[1:]
    panels = figure.subplots(1, MOMENTS)
    left, right, top, bottom = _around(masks.object[[first[place][0] for place in places]])
    for panel, place in zip(panels, places, strict=True):
        frame, shape = first[place][0], first[place][1].shape
        height, width = masks.object.shape[1:]
        panel.contourf(masks.object[frame].astype(float), [0.5, 1.5], colors=["#e4e4e4"])
        panel.contour(masks.object[frame].astype(float), [0.5], colors=[OBSERVED], linewidths=0.8)
        across, down = (np.arange(n) * size / n for n, size in zip(shape[::-1], (width, height), strict=True))
        for (silhouettes_, _), color in zip(seen.values(), COLORS, strict=False):
            panel.contour(
                across, down, silhouettes_[place][1].astype(float), [0.5], colors=[color], linewidths=1.1
            )
        panel.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", xticks=[], yticks=[])
        panel.set_title(f"frame {frame}", fontsize=SMALL, color=MUTED)
    figure.suptitle(f"{title}, mean IoU of silhouettes", fontsize=SMALL, x=0.01, ha="left")
    handles = [Line2D([], [], color=OBSERVED, linewidth=0.8, label="clip")] + [
        Line2D([], [], color=color, linewidth=1.1, label=f"{name} {value:.3f}")
        for (name, (_, value)), color in zip(seen.items(), COLORS, strict=False)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=SMALL)
    return figure


def _around(masks: Bool[Array, "n H W"]) -> tuple[float, float, float, float]:
    """Left, right, top, bottom of what is seen in any of them, with room around it [px]."""
    rows, columns = np.nonzero(masks.any(axis=0))
    room = 0.25 * max(np.ptp(rows), np.ptp(columns))
    return columns.min() - room, columns.max() + room, rows.min() - room, rows.max() + room


def _given(words: list[str]) -> Iterator[tuple[str, TwinBundle]]:
    for word in words:
        name, _, path = word.partition("=")
        yield name, TwinBundle.load(Path(path))


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("clip", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("twins", nargs="+", metavar="NAME=TWIN", help="at most two")
    given = parser.parse_args()
    frames = read_video(given.clip)
    masks = by_name(ALL_SEGMENTERS, "classical", "segmentation")()(
        frames, read_prompt(frames, mask=None, box=None, keyframe=None)
    )
    seen = {name: silhouettes(twin, frames, masks) for name, twin in _given(given.twins)}
    with replacing(given.picture) as temporary:
        temporary.write_bytes(png(compared(given.clip.stem, masks, seen)))
    for name, (_, overlap) in seen.items():
        print(f"{given.clip.stem} {name}: {overlap:.3f}")


if __name__ == "__main__":
    main()
