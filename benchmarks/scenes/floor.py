"""How closely a twin with the true parameters follows the generated world, and how much they matter.

`python benchmarks/scenes/floor.py --objects 4 --seed 1` prints, per class and per interaction, the mean track
error over the mean motion (averaged over cases, each at most 1): with the true parameters (×1) and with
every modulus, then the dashpot, scaled; and the scale at which the error is least, which is 1 where the
truth is an unbiased label.
"""

import argparse
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch

from model.scenes.case import Case
from model.scenes.replay import replay
from model.scenes.true_parameters import true_parameters
from model.scenes.world.cases import draw_cases
from model.scenes.world.shapes import CLASSES
from model.types import Array, Parameters

SCALES = (0.25, 0.5, 0.71, 1.0, 1.41, 2.0, 4.0)


def stiffer(parameters: Parameters, scale: float) -> Parameters:
    """Every modulus scaled; hands as firm as they are."""
    return replace(parameters, stiffness=parameters.stiffness * np.float32(scale))


def damped(parameters: Parameters, scale: float) -> Parameters:
    """The dashpot scaled."""
    entry = parameters.globals["dashpot_damping"]
    value = replace(entry, value=float(np.asarray(entry.value)) * scale)
    return replace(parameters, globals={**parameters.globals, "dashpot_damping": value})


def errors(case: Case, change: Callable[[Parameters, float], Parameters]) -> Array:
    """Mean track error [m] at each scale; the motion is not known where a twin diverges."""
    true = true_parameters(case)
    found = []
    for scale in SCALES:
        moved = replay(case, change(true, scale))
        found.append(np.linalg.norm(moved - case.complete, axis=2).mean())
    return np.array(found)


def best(error: Array) -> float:
    """The scale of least error: the vertex of the parabola through the three lowest neighbours."""
    logs = np.log(SCALES)
    at = int(np.clip(error.argmin(), 1, len(logs) - 2))
    a, b, _ = np.polyfit(logs[at - 1 : at + 2], np.log(error[at - 1 : at + 2]), 2)
    return float(np.exp(np.clip(-b / (2.0 * a), logs[0], logs[-1]))) if a > 0.0 else float("nan")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--objects", type=int, default=4)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--classes", nargs="*", default=CLASSES)
    parser.add_argument("--dashpot", action="store_true", help="scale the dashpot too")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    rows: dict[str, list[Array]] = defaultdict(list)
    for number, kind in enumerate(arguments.classes):
        for index in range(arguments.objects):
            for case in draw_cases(arguments.seed, 1000 * number + index, kind):
                motion = np.linalg.norm(case.complete - case.rest, axis=2).mean()
                error = errors(case, stiffer)
                row = error / motion
                if arguments.dashpot:
                    row = np.concatenate([row, errors(case, damped) / motion])
                for name in (kind, case.interaction):
                    rows[name].append(np.append(motion * 1e3, np.minimum(row, 1.0)))
    _print(rows, arguments.dashpot)


def _print(rows: dict[str, list[Array]], dashpot: bool) -> None:
    heads = ["cases", "motion mm", *(f"E×{scale:g}" for scale in SCALES), "best E"]
    heads += [*(f"γ×{scale:g}" for scale in SCALES), "best γ"] if dashpot else []
    print("| | " + " | ".join(heads) + " |\n|" + "---|" * (len(heads) + 1))
    for name, found in rows.items():
        table = np.stack(found)
        values = [float(len(table)), float(np.median(table[:, 0]))]
        for part in np.split(table[:, 1:], table.shape[1] // len(SCALES), axis=1):
            middle = part.mean(axis=0)
            values += [*middle, best(middle)]
        print(f"| {name} | " + " | ".join(f"{value:.3g}" for value in values) + " |")


if __name__ == "__main__":
    main()
