"""Whether a prompt fits the frames, and what is doubtful about masks."""

import numpy as np
from jaxtyping import Bool, Float32

from model.errors import InputError
from model.segmentation.regions import grown
from model.types import Array, Prompt


def check_prompt(prompt: Prompt, count: int, height: int, width: int) -> None:
    """Refuse a prompt that does not fit `count` frames of `width` × `height` pixels.

    Raises:
        InputError: one line says what does not fit.
    """
    if prompt.keyframe is not None and not 0 <= prompt.keyframe < count:
        raise InputError(f"keyframe {prompt.keyframe} is outside of the clip's frames 0 to {count - 1}")
    if prompt.mask is not None:
        if prompt.mask.shape != (height, width):
            had = f"{prompt.mask.shape[1]}×{prompt.mask.shape[0]}"
            raise InputError(f"the mask is {had} pixels, the frames are {width}×{height}")
        if not prompt.mask.any():
            raise InputError("the mask is empty: it marks no pixel of the object")
    if prompt.box is not None:
        x, y, w, h = prompt.box
        if w <= 0 or h <= 0 or x < 0 or y < 0 or x + w > width or y + h > height:
            raise InputError(f"the box {x},{y},{w},{h} does not lie within the {width}×{height} frames")


def doubts(
    lab: Float32[Array, "H W 3"],
    objects: Bool[Array, "T H W"],
    hands: Bool[Array, "T H W"],
    keyframe: int,
) -> tuple[str, ...]:
    """Warnings about the masks of a clip; `lab` is its keyframe."""
    warnings = []
    if not hands.any():
        warnings.append("no hand was found at the object")
    areas = objects.sum((1, 2))
    if lost := int((areas == 0).sum()):
        warnings.append(f"the object was lost in {lost} of {len(areas)} frames")
    elif areas.max() > 2.5 * areas.min():
        warnings.append(
            f"the object's visible area changes {areas.max() / areas.min():.1f}-fold: some masks may be wrong"
        )
    rim = np.ones(objects.shape[1:], bool)
    rim[1:-1, 1:-1] = False
    if cut := int((objects & rim).any((1, 2)).sum()):
        warnings.append(f"the object touches the picture's border in {cut} of {len(areas)} frames")
    mask = objects[keyframe]
    around = grown(mask, 8) & ~grown(mask, 2) & ~hands[keyframe]
    if mask.any() and around.any():
        inside, outside = np.median(lab[mask], axis=0), np.median(lab[around], axis=0)
        if float(np.linalg.norm(inside - outside)) < 8:
            warnings.append("low contrast between the object and what is around it: its outline is a guess")
    return tuple(warnings)
