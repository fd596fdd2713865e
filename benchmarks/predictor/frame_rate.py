"""What a predictor's answer changes by if the film has fewer frames a second.

    python benchmarks/predictor/frame_rate.py CASE.case.npz ... [--every 4] [--predictor FILE.safetensors]

Each case is described as it is, then with every N-th frame alone: as if filmed at the usual rate
(`model/encoders/frame_rate.py`), as `matphys twin` does, and frame by frame, whatever time lies between.
Printed are the changes of ln E of each part and of ln of dashpot, drag and friction, and their mean size.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float64

from model.encoders import kinematic
from model.encoders.frame_rate import at_frame_rate
from model.encoders.motion import MotionClip, ReferenceMotion
from model.predictor.trained import SHIPPED, TrainedPredictor
from model.scenes.case import Case
from model.scenes.files import load_case
from model.types import Array

GLOBALS = ("dashpot_damping", "drag_rate", "friction")


def frame_by_frame(clip: MotionClip, references: ReferenceMotion) -> tuple[MotionClip, ReferenceMotion]:
    """As it was filmed."""
    return clip, references


def thinned(case: Case, every: int) -> Case:
    """With every N-th frame of it alone."""
    seen = case.observation
    fewer = replace(
        seen,
        times=seen.times[::every],
        points=seen.points[::every],
        controllers=seen.controllers[::every],
    )
    complete = None if case.complete is None else case.complete[::every]
    return replace(case, observation=fewer, complete=complete, split=(case.split - 1) // every + 1)


def answer(predictor: TrainedPredictor, case: Case) -> Float64[Array, " m"]:
    """Mean ln stiffness of each part's springs, then ln of `GLOBALS`."""
    parameters = predictor(case)
    part = case.topology.part[case.topology.springs[:, 0]]
    stiffness = np.log(parameters.stiffness.astype(np.float64))
    parts = [stiffness[part == number].mean() for number in np.unique(part)]
    return np.array([*parts, *(np.log(parameters.globals[name].value) for name in GLOBALS)])


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cases", type=Path, nargs="+")
    parser.add_argument("--every", type=int, default=4)
    parser.add_argument("--predictor", type=Path, default=SHIPPED)
    given = parser.parse_args()
    torch.set_num_threads(1)
    predictor = TrainedPredictor(given.predictor)
    sizes: list[list[float]] = []
    for path in given.cases:
        case = load_case(path)
        whole, fewer = answer(predictor, case), thinned(case, given.every)
        changes = []
        for way in (at_frame_rate, frame_by_frame):
            kinematic.at_frame_rate = way
            changes.append(answer(predictor, fewer) - whole)
        kinematic.at_frame_rate = at_frame_rate
        print(path.name, *(np.round(change, 2) for change in changes), flush=True)
        sizes.append([float(np.abs(change).mean()) for change in changes])
    means, most = np.mean(sizes, axis=0), np.max(sizes, axis=0)
    print(f"mean {means[0]:.3f}, at most {most[0]:.2f} as if filmed at the usual rate")
    print(f"mean {means[1]:.3f}, at most {most[1]:.2f} frame by frame")


if __name__ == "__main__":
    main()
