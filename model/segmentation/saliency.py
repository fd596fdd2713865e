"""What stands out from a picture's surroundings, with no idea of what it is."""

import itertools

import cv2
import numpy as np
from jaxtyping import Bool, Float32

from model.types import Array


def border_distance(lab: Float32[Array, "H W 3"], passes: int = 3) -> Float32[Array, "H W"]:
    """Least change of colour [Lab units] that a path from each pixel to the picture's border must see.

    Plain surroundings reach the border for next to nothing, however large or shaded they are; whatever
    they enclose does not.

    Reference:
        Zhang et al. (2015), Minimum barrier salient object detection at 80 fps (the distance; the
        sweeps here run over whole rows and columns).
    """
    height, width = lab.shape[:2]
    distance = np.full((height, width), np.inf, np.float32)
    distance[0] = distance[-1] = distance[:, 0] = distance[:, -1] = 0
    high, low = lab.copy(), lab.copy()

    def relax(row: tuple[slice, ...], before: tuple[slice, ...]) -> None:
        top, bottom = np.maximum(high[before], lab[row]), np.minimum(low[before], lab[row])
        cost = (top - bottom).sum(-1)
        better = cost < distance[row]
        distance[row] = np.where(better, cost, distance[row])
        high[row] = np.where(better[..., None], top, high[row])
        low[row] = np.where(better[..., None], bottom, low[row])

    rows = [(slice(y, y + 1),) for y in range(height)]
    columns = [(slice(None), slice(x, x + 1)) for x in range(width)]
    for _ in range(passes):
        for line in (rows, columns, rows[::-1], columns[::-1]):
            for before, after in itertools.pairwise(line):
                relax(after, before)
    return distance


def border_colors(lab: Float32[Array, "H W 3"], clusters: int = 12) -> Float32[Array, "H W"]:
    """How strongly each pixel's colour lives at the border, 0 (not at all) to 1.

    A colour that meets the border along much more than its size would explain belongs to surroundings.

    Reference:
        Zhu et al. (2014), Saliency optimization from robust background detection, eq. 1 (over colour
        clusters instead of superpixels).
    """
    height, width = lab.shape[:2]
    cv2.setRNGSeed(0)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 15, 0.5)
    weighted = lab * np.array([0.6, 1.3, 1.3], np.float32)
    samples = np.ascontiguousarray(weighted.reshape(-1, 3))
    guess = np.zeros((len(samples), 1), np.int32)
    _, labels, _ = cv2.kmeans(samples, clusters, guess, stop, 1, cv2.KMEANS_PP_CENTERS)
    labels = labels.reshape(height, width)
    border = np.ones((height, width), bool)
    border[1:-1, 1:-1] = False
    area = np.bincount(labels.ravel(), minlength=clusters)
    length = np.bincount(labels[border], minlength=clusters)
    connectivity = length / np.sqrt(np.maximum(area, 1))
    return np.asarray((1 - np.exp(-0.5 * np.square(connectivity)))[labels], np.float32)


def reach(hand: Bool[Array, "H W"], scale: float) -> Float32[Array, "H W"]:
    """1 at the far ends of the hands, falling off with distance; 1 everywhere where there is no hand.

    The far end of an arm that comes in over the border is the end away from there.
    """
    height, width = hand.shape
    if not hand.any():
        return np.ones((height, width), np.float32)
    tips = np.zeros_like(hand)
    count, labels = cv2.connectedComponents(hand.astype(np.uint8))
    for label in range(1, count):
        part = labels == label
        inner = part.copy()
        inner[1:-1, 1:-1] = False
        if not inner.any():
            tips |= part
            continue
        entry = np.argwhere(inner).mean(0)
        pixels = np.argwhere(part)
        away = np.linalg.norm(pixels - entry, axis=1)
        far = pixels[away > 0.6 * away.max()]
        tips[far[:, 0], far[:, 1]] = True
    distance = cv2.distanceTransform((~tips).astype(np.uint8), cv2.DIST_L2, 5)
    return np.asarray(np.exp(-np.square(distance / (scale * np.hypot(height, width)))), np.float32)
