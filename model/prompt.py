"""What the user says about the object on the keyframe, read and checked."""

from pathlib import Path

import av
import cv2
import numpy as np
from jaxtyping import Bool

from model.errors import InputError
from model.types import Array, Frames, Prompt

MAX_MASK_PIXELS = 64_000_000


def read_prompt(
    frames: Frames, *, mask: Path | None, box: tuple[int, int, int, int] | None, keyframe: int | None
) -> Prompt:
    """Read a mask image and check it, the box and the keyframe against the clip.

    Args:
        frames: The clip.
        mask: A grey or colour image of the clip's size; the object is where it is brighter than half.
        box: x, y, width, height [px].
        keyframe: The frame of the clip that mask and box speak of; of a thinned clip the nearest one that
            was kept stands for it. None: the segmenter chooses, or 0 with a mask or box.

    Raises:
        InputError: the mask cannot be read, has another size or is empty; the box lies outside;
            the keyframe is not one of the frames, or nothing follows it.
    """
    height, width = frames.images.shape[1:3]
    size = frames.source_size or (width, height)
    doubts: tuple[str, ...] = ()
    if keyframe is not None:
        asked, keyframe = keyframe, _kept(frames, keyframe)
        if frames.number(keyframe) != asked:
            instead = frames.number(keyframe)
            doubts = (f"frame {asked} was left out in thinning the clip: the keyframe is {instead}",)
    if mask is not None and box is not None:
        raise InputError("--mask and --box both given: choose one")
    pixels = None
    if mask is not None:
        pixels = _read_mask(mask)
        found = (pixels.shape[1], pixels.shape[0])
        if found not in (size, (width, height)):
            raise InputError(
                f"{mask}: the mask is {found[0]}×{found[1]} pixels, {frames.name} is {size[0]}×{size[1]}: "
                "give a mask of the clip's size"
            )
        if not pixels.any():
            raise InputError(f"{mask}: the mask is empty: paint the object white on black")
        if found != (width, height):
            resized = cv2.resize(pixels.astype(np.uint8), (width, height), interpolation=cv2.INTER_AREA)
            pixels = resized > 0
    if box is not None:
        x, y, w, h = box
        if w <= 0 or h <= 0 or x < 0 or y < 0 or x + w > size[0] or y + h > size[1]:
            raise InputError(f"--box {x},{y},{w},{h} does not lie inside the {size[0]}×{size[1]} frame")
        box = _scale_box(box, frames.scale)
    if keyframe is None and (mask is not None or box is not None):
        keyframe = 0
    return Prompt(mask=pixels, box=box, keyframe=keyframe, warnings=doubts)


def _kept(frames: Frames, keyframe: int) -> int:
    """Which of the frames that were kept stands for the clip's frame `keyframe`."""
    if not 0 <= keyframe < frames.length:
        raise InputError(f"--keyframe {keyframe}: {frames.name} has frames 0 to {frames.length - 1}")
    index = frames.index(keyframe)
    if index == len(frames.images) - 1:
        last = frames.number(index - 1)
        raise InputError(
            f"--keyframe {keyframe}: nothing follows it in {frames.name}; "
            f"choose one of the frames 0 to {last}"
        )
    return index


def _scale_box(box: tuple[int, int, int, int], scale: float) -> tuple[int, int, int, int]:
    x, y, w, h = (round(value * scale) for value in box)
    return x, y, max(w, 1), max(h, 1)


def _read_mask(path: Path) -> Bool[Array, "H W"]:
    if not path.is_file():
        raise InputError(f"{path}: no such mask file")
    try:
        # As a stream: a colon in a name is no protocol, and a per cent sign no numbering of files.
        with path.open("rb") as file, av.open(file, "r") as container:
            stream = container.streams.video[0]
            if stream.width * stream.height > MAX_MASK_PIXELS:
                raise InputError(f"{path}: {stream.width}×{stream.height} pixels is too large for a mask")
            frame = next(container.decode(video=0))
            # a palette may have a colour that is transparent
            has_alpha = frame.format.has_palette or "a" in frame.format.name
            grey = frame.to_ndarray(format="gray")
            alpha = frame.to_ndarray(format="rgba")[..., 3] if has_alpha else None
    except (av.FFmpegError, OSError, IndexError, StopIteration) as error:
        raise InputError(f"{path}: not a readable image: give a PNG, white where the object is") from error
    mask: Bool[Array, "H W"] = grey > 127
    if alpha is not None and not (alpha > 127).all():
        mask &= alpha > 127
    return mask
