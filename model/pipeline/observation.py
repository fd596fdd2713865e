"""What really moved in a clip, as its twin sees it."""

from pathlib import Path

from model.bundle import TwinBundle
from model.observe.clip import observe_clip
from model.registry import by_name
from model.segmentation import ALL_SEGMENTERS
from model.stage_log import StageReport
from model.tracking import ALL_TRACKERS
from model.types import Observation


def observe(
    video: Path,
    twin: Path,
    segmentation: str,
    tracking: str,
    mask: Path | None,
    report: StageReport,
    box: tuple[int, int, int, int] | None = None,
    fps: float | None = None,
) -> Observation:
    """Say what really moved in a clip, as the twin of that clip sees it.

    Args:
        video: The clip.
        twin: Its twin.
        segmentation: Method that finds the object.
        tracking: Method that follows it.
        mask: The object on the keyframe, white on black.
        report: Told which stage begins and how far the whole is.
        box: Around the object on the keyframe, x, y, width, height [px].
        fps: Frame rate of a clip that is a folder of images [1/s].

    Raises:
        InputError: they do not belong together, or cannot be used; the message is one line.
    """
    segmenter = by_name(ALL_SEGMENTERS, segmentation, "segmentation")()
    tracker = by_name(ALL_TRACKERS, tracking, "tracking")()
    bundle = TwinBundle.load(twin)
    return observe_clip(video, bundle, segmenter, tracker, report, mask=mask, box=box, fps=fps)
