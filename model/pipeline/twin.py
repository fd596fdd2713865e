"""A clip becomes a twin, stage by stage."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from model.bundle import TwinBundle
from model.pipeline.matter import understand
from model.pipeline.mechanics import mechanise
from model.pipeline.methods import choose
from model.pipeline.options import TwinOptions
from model.pipeline.replay import replay
from model.pipeline.sight import see
from model.stage_log import StageLog, StageReport

SHARES = {
    "video": 1.0,
    "segmentation": 12.0,
    "shape": 0.2,
    "calibration": 1.0,
    "reconstruction": 4.0,
    "features": 2.0,
    "parts": 2.0,
    "prior": 1.0,
    "tracking": 4.0,
    "controllers": 1.0,
    "topology": 2.0,
    "prior parameters": 0.5,
    "grip": 6.0,
    "parameters": 6.0,
    "simulation": 10.0,
    "preview": 8.0,
}
"""What each stage roughly costs, for the progress bar alone."""


@dataclass(frozen=True)
class TwinResult:
    """A twin and what it cost."""

    bundle: TwinBundle
    seconds: Mapping[str, float]
    """Measured per stage; not in the bundle, whose bytes depend on its input alone."""


def build_twin(video: Path, options: TwinOptions, report: StageReport) -> TwinResult:
    """Turn a clip into a simulatable twin.

    Args:
        video: A video file, or a folder of numbered images.
        options: What the user chose.
        report: Told which stage begins and how far the whole is.

    Raises:
        InputError: the clip or an option cannot be used; the message is one line for the user.
    """
    methods = choose(options)
    log = StageLog(SHARES, report)
    sight = see(video, options, methods, log)
    matter = understand(sight, options, methods, log)
    bundle = mechanise(sight, matter, options, methods, log)
    bundle = replay(bundle, sight, methods.renderer, log)
    report("done", 1.0)
    return TwinResult(bundle, log.seconds)
