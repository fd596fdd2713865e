"""How well the object's masks match outlines drawn by eye on three frames of each real clip.

    python benchmarks/masks/evaluate.py                    # the default segmenter
    python benchmarks/masks/evaluate.py --method NAME      # another one of model.segmentation.ALL_SEGMENTERS
    python benchmarks/masks/evaluate.py --masks DIR        # masks on disk: DIR/CLIP/FRAME.png, object white
    python benchmarks/masks/evaluate.py --draw DIR         # write the outlines as such pictures, for `--mask`

The clips are looked for in $MATPHYS_DATA/videos (default: ../shared/data beside the repository).
Boundary F: Csurka et al. (2013), What is a good evaluation measure for semantic segmentation?, BMVC.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Bool

from model.errors import InputError
from model.registry import by_name
from model.segmentation import ALL_SEGMENTERS, Segmenter
from model.types import Array, Prompt
from model.video import read_video

HERE = Path(__file__).resolve().parent
TOLERANCE = 2.0
"""How far apart two boundaries may lie and still agree [px]."""
SUBPIXELS = 8
"""Outlines are rasterised this much finer: fillPoly paints the outline itself, half a pixel too wide."""

Rings = list[list[list[float]]]
Predicted = Callable[[int], Bool[Array, "H W"]]


def rasterise(outer: Rings, holes: Rings, width: int, height: int) -> Bool[Array, "H W"]:
    """Pixels at least half covered by the outlines (even-odd, so a ring in a ring is a hole)."""
    fine = np.zeros((height * SUBPIXELS, width * SUBPIXELS), np.uint8)
    rings = [np.rint((np.array(ring) + 0.5) * SUBPIXELS - 0.5).astype(np.int32) for ring in outer + holes]
    cv2.fillPoly(fine, rings, 255)
    return cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA) >= 128


def iou(a: Bool[Array, "H W"], b: Bool[Array, "H W"]) -> float:
    """Intersection over union; 1 where both are empty."""
    union = np.count_nonzero(a | b)
    return np.count_nonzero(a & b) / union if union else 1.0


def boundary_f(a: Bool[Array, "H W"], b: Bool[Array, "H W"], tolerance: float = TOLERANCE) -> float:
    """Harmonic mean of the shares of either boundary within `tolerance` [px] of the other.

    The border of the image is no boundary: what leaves the picture has no outline there.
    """
    edges = [mask & (cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) == 0) for mask in (a, b)]
    if not (edges[0].any() and edges[1].any()):
        return float(not edges[0].any() and not edges[1].any())
    away = [
        cv2.distanceTransform((~edge).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) for edge in edges
    ]
    precision = float(np.mean(away[1][edges[0]] <= tolerance))
    recall = float(np.mean(away[0][edges[1]] <= tolerance))
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


def segmented(video: Path, segmenter: Segmenter) -> Predicted:
    """The object as `segmenter` finds it in `video`."""
    masks = segmenter(read_video(video), Prompt())
    return lambda frame: masks.object[frame]


def on_disk(folder: Path) -> Predicted:
    """The object as pictures in `folder` have it; they are numbered with or without leading zeros."""
    files = {int(file.stem): file for file in folder.glob("*.png") if file.stem.isdigit()}

    def load(frame: int) -> Bool[Array, "H W"]:
        image = cv2.imread(str(files[frame]), cv2.IMREAD_GRAYSCALE) if frame in files else None
        if image is None:
            raise InputError(
                f"no readable mask of frame {frame} in {folder}: write {folder / f'{frame}.png'}"
            )
        return image > 127

    return load


def drawn_masks(truth: dict[str, Any]) -> dict[int, Bool[Array, "H W"]]:
    """The outlines of a clip as masks, by frame."""
    return {
        drawn["frame"]: rasterise(
            drawn["object"]["outer"], drawn["object"]["holes"], truth["width"], truth["height"]
        )
        for drawn in truth["frames"]
    }


def write_drawn(truth: dict[str, Any], folder: Path) -> None:
    """Each drawn frame as FOLDER/CLIP/FRAME.png, the object white."""
    for frame, mask in drawn_masks(truth).items():
        picture = folder / truth["clip"] / f"{frame}.png"
        picture.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(picture), mask.astype(np.uint8) * 255)
        print(f"wrote {picture}")


def rows(truth: dict[str, Any], predicted: Predicted, seconds: float) -> list[str]:
    """The table's lines for one clip: one per drawn frame, then their mean."""
    lines, scores = [], []
    for frame, outline in drawn_masks(truth).items():
        mask = predicted(frame)
        if mask.shape != outline.shape:
            raise InputError(
                f"{truth['clip']}: masks are {mask.shape}, the outlines {outline.shape} (rows, columns)"
            )
        scores.append((iou(mask, outline), boundary_f(mask, outline)))
        lines.append(f"| {truth['clip']} | {frame} | {scores[-1][0]:.3f} | {scores[-1][1]:.3f} | |")
    mean = np.mean(scores, axis=0)
    return [
        *lines,
        f"| **{truth['clip']}** | **mean** | **{mean[0]:.3f}** | **{mean[1]:.3f}** | {seconds:.1f} |",
    ]


def main() -> None:
    """Score every clip that is both drawn here and present, as a Markdown table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--method", default=ALL_SEGMENTERS[0].name, help="a segmenter's name")
    source.add_argument("--masks", type=Path, help="score these pictures instead of running a segmenter")
    source.add_argument(
        "--draw", type=Path, help="write the outlines as pictures below this folder, no scores"
    )
    options = parser.parse_args()
    data = Path(os.environ.get("MATPHYS_DATA", HERE.parents[1].parent / "shared" / "data")) / "videos"
    truths = [json.loads(file.read_text()) for file in sorted(HERE.glob("*.json"))]
    if options.draw:
        for truth in truths:
            write_drawn(truth, options.draw)
        return
    if options.masks:
        inputs = {truth["clip"]: options.masks / truth["clip"] for truth in truths}
    else:
        inputs = {truth["clip"]: data / f"{truth['clip']}.mp4" for truth in truths}
    found = [truth for truth in truths if inputs[truth["clip"]].exists()]
    if not found:
        raise InputError(
            f"none of the drawn clips is in {options.masks or data}: set MATPHYS_DATA or give --masks"
        )
    segmenter = None if options.masks else by_name(ALL_SEGMENTERS, options.method, "segmentation")()
    print(f"| clip | frame | IoU | boundary F ({TOLERANCE:.0f} px) | seconds |\n|---|---|---|---|---|")
    for truth in found:
        start = time.perf_counter()
        where = inputs[truth["clip"]]
        predicted = segmented(where, segmenter) if segmenter else on_disk(where)
        print("\n".join(rows(truth, predicted, time.perf_counter() - start)), flush=True)


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
