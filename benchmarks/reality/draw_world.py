"""Draw observations as strips of frames, to look at what a generator makes.

python -m benchmarks.reality.draw_world out/worlds/dev/*.npz --out out/worlds/sheet.png
"""

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np

from benchmarks.reality.world import Array

SIZE, FRAMES = 220, 7
HAND, GROUND = (40, 40, 220), (170, 170, 170)


def strip(points: Array, controllers: Array, ground: float | None, title: str) -> Array:
    """Frames side by side of points [T, N, 3] and hands [T, C, 3], seen from in front and above."""
    view = np.array([[0.94, 0.34, 0.0], [0.12, -0.32, 0.94]])
    flat, hands = points @ view.T, controllers @ view.T
    everything = np.concatenate([flat.reshape(-1, 2), hands.reshape(-1, 2)])
    low, high = np.nanmin(everything, axis=0), np.nanmax(everything, axis=0)
    scale = 0.86 * SIZE / (high - low).max()

    def pixels(at: Array) -> Array:
        centred = (at - (low + high) / 2) * scale
        return np.column_stack([SIZE / 2 + centred[:, 0], SIZE / 2 - centred[:, 1]]).round().astype(int)

    ramp = np.linspace(0, 255, points.shape[1]).astype(np.uint8)
    color = cv2.applyColorMap(ramp, cv2.COLORMAP_VIRIDIS).reshape(-1, 3)
    order = np.argsort(np.argsort(np.nan_to_num(points[0, :, 0])))
    panels = []
    for t in np.linspace(0, len(points) - 1, FRAMES).astype(int):
        panel = np.full((SIZE, SIZE, 3), 255, np.uint8)
        if ground is not None:
            middle = np.nanmedian(points[..., :2], axis=(0, 1))
            floor = np.array([[*middle, ground]]) + np.array(
                [[-0.6, 0, 0], [0.6, 0, 0], [0, -0.6, 0], [0, 0.6, 0]]
            )
            a, b, c, d = pixels(floor @ view.T)
            cv2.line(panel, tuple(map(int, a)), tuple(map(int, b)), GROUND, 1, cv2.LINE_AA)
            cv2.line(panel, tuple(map(int, c)), tuple(map(int, d)), GROUND, 1, cv2.LINE_AA)
        seen = ~np.isnan(points[t, :, 0])
        for k, place in zip(np.flatnonzero(seen), pixels(flat[t][seen]), strict=True):
            cv2.circle(panel, tuple(map(int, place)), 2, tuple(map(int, color[order[k]])), -1, cv2.LINE_AA)
        for place in pixels(hands[t]):
            cv2.circle(panel, tuple(map(int, place)), 3, HAND, 1, cv2.LINE_AA)
        panels.append(panel)
    row = np.concatenate(panels, axis=1)
    cv2.putText(row, title, (4, 12), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (0, 0, 0), 1, cv2.LINE_AA)
    return row


def main(arguments: list[str] | None = None) -> int:
    """Draw files."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("worlds", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(arguments)
    rows = []
    for path in options.worlds:
        with np.load(path) as world:
            ground = float(world["ground_height"]) if "ground_height" in world else None
            rows.append(strip(world["points"], world["controllers"], ground, path.stem))
    options.out.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(options.out), np.concatenate(rows))
    print(f"wrote {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
