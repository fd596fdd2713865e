"""SAM 2 through `transformers`, for those who have its weights."""

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import cv2
import numpy as np
import torch
from jaxtyping import Float, UInt8
from safetensors import SafetensorError

from model.errors import InputError, MissingDependencyError
from model.segmentation.base import Segmenter
from model.segmentation.classical import ClassicalSegmenter
from model.types import Array, Frames, Masks, Prompt

if TYPE_CHECKING:
    from collections.abc import Mapping

ENVIRONMENT = "MATPHYS_SAM2"
MEAN, STD = np.array([0.485, 0.456, 0.406], np.float32), np.array([0.229, 0.224, 0.225], np.float32)
"""Of ImageNet, which SAM 2 was trained with."""
OBJECT, HAND = 0, 1
BOX_CORNERS = (2, 3)
"""SAM 2's labels of the two corners of a box."""


class Sam2Segmenter(Segmenter):
    """SAM 2 video: prompted on the keyframe by the classical masks or the user, carried by its memory.

    Reference:
        Ravi et al. (2024), SAM 2: Segment anything in images and videos.
    """

    name: ClassVar[str] = "sam2"
    version: ClassVar[str] = "1"

    def __init__(self, folder: str | Path | None = None) -> None:
        """Look for weights.

        Args:
            folder: A checkpoint in the hub's format (`config.json`, `model.safetensors`), for example
                of `facebook/sam2.1-hiera-tiny`; default: the environment variable MATPHYS_SAM2.

        Raises:
            MissingDependencyError: there is no such folder, or it is incomplete.
        """
        given = folder or os.environ.get(ENVIRONMENT)
        if not given:
            raise MissingDependencyError(
                f"sam2 needs weights: download facebook/sam2.1-hiera-tiny and set {ENVIRONMENT} to its folder"
            )
        self.folder = Path(given)
        file = self.folder / "model.safetensors"
        for needed in (self.folder / "config.json", file):
            if not needed.is_file():
                raise MissingDependencyError(f"{needed}: no such file; sam2 needs a checkpoint folder there")
        with file.open("rb") as stream:
            self.weights = hashlib.file_digest(stream, "sha256").hexdigest()

    def __call__(self, frames: Frames, prompt: Prompt) -> Masks:
        """Segment the clip.

        Args:
            frames: The clip.
            prompt: A mask or a box of the object on the keyframe; without one, the classical method's.

        Raises:
            InputError: no object can be found to start from, or the prompt does not fit the frames.
        """
        model = self._model()
        start = ClassicalSegmenter()(frames, prompt)
        session = _session(model, frames)
        key = start.keyframe
        seeds = (prompt.mask if prompt.mask is not None else start.object[key], start.hand[key])
        height, width = frames.images.shape[1:3]
        tracked = [OBJECT, HAND] if seeds[HAND].any() else [OBJECT]
        for which in tracked:
            index = session.obj_id_to_idx(which)
            if which == OBJECT and prompt.box is not None and prompt.mask is None:
                session.add_point_inputs(index, key, _corners(prompt.box, width, height, model.image_size))
            else:
                session.add_mask_inputs(index, key, _resized(seeds[which], model.image_size))
        session.obj_with_new_inputs = list(tracked)
        masks = Masks(np.zeros_like(start.object), np.zeros_like(start.hand), key)
        with torch.inference_mode():
            for index, logits in _propagated(model, session, key):
                score = [_enlarged(part, width, height) for part in logits]
                masks.object[index] = score[OBJECT] > 0
                if len(score) > HAND:
                    masks.object[index] &= score[OBJECT] >= score[HAND]
                    masks.hand[index] = (score[HAND] > 0) & ~masks.object[index]
                else:  # SAM 2 follows what the keyframe shows: a hand that comes later is the classical one
                    masks.hand[index] = start.hand[index] & ~masks.object[index]
        if prompt.mask is not None:
            masks.object[key] = prompt.mask
            masks.hand[key] &= ~prompt.mask
        lost = int((~masks.object.any((1, 2))).sum())
        warnings = (f"the object was lost in {lost} of {len(masks.object)} frames",) if lost else ()
        return Masks(masks.object, masks.hand, key, warnings)

    def _model(self) -> Any:  # noqa: ANN401 - a transformers class, imported only here
        try:
            from transformers import Sam2VideoModel
            from transformers.utils import logging
        except ImportError:
            raise MissingDependencyError("sam2 needs transformers: pip install 'matphys[weights]'") from None
        logging.disable_progress_bar()
        try:
            model, report = Sam2VideoModel.from_pretrained(
                self.folder, local_files_only=True, output_loading_info=True
            )
        except (OSError, ValueError, RuntimeError, AttributeError, SafetensorError) as error:
            reason = str(error).splitlines()[0]
            raise InputError(f"{self.folder}: not a checkpoint of SAM 2 video: {reason}") from None
        if report["missing_keys"]:  # transformers would go on with random numbers in their place
            lacking = min(report["missing_keys"])
            raise InputError(f"{self.folder}: not a checkpoint of SAM 2 video: it lacks {lacking} and others")
        return model.eval()


class _Pictures:
    """The frames as SAM 2 wants them, made one at a time: all of them would take gigabytes."""

    def __init__(self, images: UInt8[Array, "T H W 3"], side: int) -> None:
        self.images, self.side = images, side

    def __len__(self) -> int:
        return len(self.images)

    def __getitem__(self, index: int) -> torch.Tensor:
        resized = cv2.resize(self.images[index], (self.side, self.side), interpolation=cv2.INTER_LINEAR)
        normal = (resized.astype(np.float32) / 255 - MEAN) / STD
        return torch.from_numpy(np.ascontiguousarray(normal.transpose(2, 0, 1)))


def _session(model: Any, frames: Frames) -> Any:  # noqa: ANN401 - transformers classes
    from transformers.models.sam2_video.modeling_sam2_video import Sam2VideoInferenceSession

    height, width = frames.images.shape[1:3]
    session = Sam2VideoInferenceSession(None, height, width, dtype=torch.float32)
    session.processed_frames = _Pictures(frames.images, model.image_size)
    return session


def _resized(mask: Array, side: int) -> torch.Tensor:
    small = cv2.resize(mask.astype(np.float32), (side, side), interpolation=cv2.INTER_AREA)
    return torch.from_numpy((small >= 0.5).astype(np.float32))[None, None]


def _corners(
    box: tuple[int, int, int, int], width: int, height: int, side: int
) -> "Mapping[str, torch.Tensor]":
    x, y, w, h = box
    scale = torch.tensor([side / width, side / height])
    points = torch.tensor([[x, y], [x + w, y + h]], dtype=torch.float32) * scale
    labels = torch.tensor(BOX_CORNERS, dtype=torch.int32)
    return {"point_coords": points[None, None], "point_labels": labels[None, None]}


def _propagated(
    model: Any,  # noqa: ANN401
    session: Any,  # noqa: ANN401
    keyframe: int,
) -> Iterator[tuple[int, Float[Array, "K h w"]]]:
    """The logits of every frame, from the keyframe to the end, then back to the start."""
    for reverse in (False, True):
        for out in model.propagate_in_video_iterator(session, start_frame_idx=keyframe, reverse=reverse):
            yield int(out.frame_idx), out.pred_masks[:, 0].float().numpy()


def _enlarged(logits: Float[Array, "h w"], width: int, height: int) -> Float[Array, "H W"]:
    return np.asarray(cv2.resize(logits, (width, height), interpolation=cv2.INTER_LINEAR))
