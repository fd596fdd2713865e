"""Gradients of long rollouts: how large, how true, and from how far they still lead to the truth.

Run: `python benchmarks/simulator/gradients.py [--frames 3 10 30 75 150] [--memory]`

Three objects, 30 frames per second: a held sheet, damped and underdamped, and a block thrown on the ground.
The loss is the mean square distance from the truth [mm²] over all frames, with stiffness a tenth off. Printed
are the norms of its gradient (by the logarithm of every spring's stiffness and of the other constants, by
m/s and by m). `true` is the slope by reverse differentiation over that by central
differences 2 % wide: of stiffness, and of friction; 1 where they agree. `basin` is the range of factors on
stiffness from which the loss falls all the way to the truth, of a scan from a quarter to four in steps of
10 %; `valleys` counts the minima of the scan. A scan is one rollout: a batch of parameter sets on one scene.

`cut` detaches the state every ten frames; `clipped` clips the adjoint of the state after every frame;
`segments` starts again every ten frames from where the truth was seen, with 1 mm of noise and velocities from
differences of that (teacher forcing), all segments in one batch.
`--memory` prints what the gradient of 150 frames takes, with and without checkpoints.
"""

import argparse
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch
from fitting import OBJECTS, Object
from torch import Tensor

from model.simulator.fitting.scene import Scene
from model.simulator.system import State

FPS, OFF, SEGMENT, NOISE, WIDTH, CLIP = 30.0, 1.1, 10, 1e-3, 1e-2, 100.0
CHOSEN = [each for each in OBJECTS if each.name.startswith("sheet") or each.thrown]
NAMES = {
    "stiffness": "spring.stiffness",
    "dashpot": "dashpot.dashpot_damping",
    "drag": "drag.drag_rate",
    "friction": "ground.friction",
    "velocity": "state.velocities",
    "controllers": "controls.offset",
}
STEPS = np.exp(np.arange(-14, 15) * np.log(1.1))
Way = Callable[[Scene, int, int], Tensor]
"""What is left of the truth [m], [t, *b, N, 3]: of a scene, its frames, and substeps."""


def plain(truth: Tensor) -> Way:
    """All frames from the first."""

    def roll(scene: Scene, frames: int, substeps: int) -> Tensor:
        points = scene.rollout(frames, substeps=substeps, checkpoint=True).points
        return points - truth[:frames].reshape(frames, *[1] * (points.ndim - 3), -1, 3)

    return roll


def cut(truth: Tensor) -> Way:
    """The same values, without the slopes from beyond the last cut."""

    def roll(scene: Scene, frames: int, substeps: int) -> Tensor:
        state, left, first = scene.state or scene.simulator.rest_state(), [], 0
        whole = scene
        while first < frames - 1:
            last = min(first + SEGMENT, frames - 1)
            held = None if whole.controls is None else whole.controls[first : last + 1]
            scene = replace(whole, times=whole.times[first : last + 1], state=state, controls=held)
            part = scene.rollout(substeps=substeps, checkpoint=True)
            here = truth[first + 1 : last + 1]
            left.append(part.points[1:] - here.reshape(len(here), *[1] * (part.points.ndim - 3), -1, 3))
            state = State(part.end.positions.detach(), part.end.velocities.detach(), part.end.memory)
            first = last
        return torch.cat(left)

    return roll


class Clamp(torch.autograd.Function):
    """Hands values on, and slopes back no larger than a limit."""

    @staticmethod
    def forward(ctx, values, limit):
        """As they are."""
        ctx.limit = limit
        return values.clone()

    @staticmethod
    def backward(ctx, slopes):
        """Each within the limit."""
        return slopes.clamp(-ctx.limit, ctx.limit), None


def clipped(truth: Tensor) -> Way:
    """The same values, slopes clipped after every frame: CLIP by place, as much in a frame by velocity."""

    def calm(_frame: int, state: State) -> State:
        places = Clamp.apply(state.positions, CLIP)
        return State(places, Clamp.apply(state.velocities, CLIP / FPS), state.memory)

    def roll(scene: Scene, frames: int, substeps: int) -> Tensor:
        held = None if scene.controls is None else scene.controls[:frames]
        times = scene.times[:frames]
        led = scene.simulator.rollout(
            scene.state, held, times=times, substeps=substeps, checkpoint=True, lead=calm
        )
        return led.points - truth[:frames].reshape(frames, *[1] * (led.points.ndim - 3), -1, 3)

    return roll


def segments(truth: Tensor) -> Way:
    """Every segment from where the truth was seen, all in one batch."""
    seen = truth + torch.from_numpy(np.random.default_rng(0).normal(0.0, NOISE, truth.shape))

    def roll(scene: Scene, frames: int, substeps: int) -> Tensor:
        first = scene.state or scene.simulator.rest_state()
        length = min(SEGMENT, frames - 1)
        starts = range(0, frames - length, SEGMENT)
        places = torch.stack([seen[s] if s else first.positions for s in starts])
        speeds = torch.stack(
            [(seen[s + 1] - seen[s - 1]) * FPS / 2 if s else first.velocities for s in starts]
        )
        there = torch.stack([truth[s : s + length + 1] for s in starts], 1)
        controls = None if scene.controls is None else scene.controls[: length + 1]
        shot = replace(scene, times=scene.times[: length + 1], state=State(places, speeds), controls=controls)
        return shot.rollout(substeps=substeps, checkpoint=True).points - there

    return roll


def loss(left: Tensor) -> Tensor:
    """Mean square distance [mm²]."""
    return 1e6 * left.square().sum(-1).mean()


def gradients(scene: Scene, names: dict[str, str], way: Way, frames: int, substeps: int) -> dict[str, Tensor]:
    """By reverse differentiation, of positive constants by their logarithm."""
    leaves, values = {}, {}
    for short, name in names.items():
        value = scene.value(name).detach().double()
        if short == "stiffness":
            value = value.expand(scene.simulator.system.edges.spring_count).clone()
        positive = scene.constant(name).positive
        leaves[short] = (value.log() if positive else value.clone()).requires_grad_()
        values[name] = leaves[short].exp() if positive else leaves[short]
    total = loss(way(scene.with_values(values), frames, substeps))
    found = torch.autograd.grad(total, list(leaves.values()), allow_unused=True, materialize_grads=True)
    return dict(zip(leaves, found, strict=True))


def slope(scene: Scene, name: str, way: Way, frames: int, substeps: int) -> float:
    """By central differences, of the logarithm."""
    value = scene.value(name).detach()
    with torch.no_grad():
        ahead, behind = (
            float(loss(way(scene.with_values({name: value * np.exp(by)}), frames, substeps)))
            for by in (WIDTH, -WIDTH)
        )
    return (ahead - behind) / (2 * WIDTH)


def scan(scene: Scene, stiffness: float, way: Way, frames: int) -> np.ndarray:
    """The loss at every factor of `STEPS`."""
    found = []
    with torch.no_grad():
        if way.__qualname__.startswith("segments"):
            for factor in STEPS:
                each = scene.with_values({"spring.stiffness": torch.tensor(stiffness * factor)})
                found.append(float(loss(way(each, frames, max(each.rollout(2).substeps)))))
            return np.array(found)
        sets = scene.with_values({"spring.stiffness": torch.from_numpy(stiffness * STEPS)[:, None]})
        left = way(sets, frames, max(sets.rollout(2).substeps))
        return 1e6 * left.square().sum(-1).mean((0, -1)).numpy()


def basin(losses: np.ndarray) -> tuple[float, float, int]:
    """The factors around 1 between which the loss only falls towards it, and the number of minima."""
    middle = len(losses) // 2
    low = high = middle
    while low and losses[low - 1] > losses[low]:
        low -= 1
    while high + 1 < len(losses) and losses[high + 1] > losses[high]:
        high += 1
    inner = (losses[1:-1] < losses[:-2]) & (losses[1:-1] < losses[2:])
    return STEPS[low], STEPS[high], int(inner.sum())


def table(each: Object, horizons: list[int]) -> None:
    """All ways and horizons of an object."""
    truth_scene = replace(each, frames=max(horizons) + 1).scene()
    truth_scene = truth_scene.with_values({"spring.stiffness": torch.tensor(60.0)})
    substeps = max(truth_scene.rollout(2).substeps)
    with torch.no_grad():
        truth = truth_scene.rollout(substeps=2 * substeps).points
    off = truth_scene.with_values({"spring.stiffness": torch.tensor(60.0 * OFF)})
    names = {s: n for s, n in NAMES.items() if s != ("controllers" if each.thrown else "friction")}
    columns = "".join(f"{name:>12}" for name in names)
    print(
        f"\n{each.name}\n{'way':10}{'frames':>7}{columns}{'true':>14}{'basin':>16}{'valleys':>8}{'seconds':>9}"
    )
    for way in (plain, cut, clipped, segments):
        for frames in horizons:
            if frames <= SEGMENT and way is not plain:
                continue
            roll, begun = way(truth), time.process_time()
            found = gradients(off, names, roll, frames + 1, substeps)
            spent = time.process_time() - begun
            asked = ["stiffness", "friction"] if each.thrown else ["stiffness"]
            true = [float(found[s].sum()) / slope(off, NAMES[s], roll, frames + 1, substeps) for s in asked]
            low, high, valleys = basin(
                scan(truth_scene, 60.0, roll if way is segments else plain(truth), frames + 1)
            )
            cells = "".join(f"{float(found[name].norm()):12.3g}" for name in names)
            cells += f"{', '.join(f'{ratio:.2f}' for ratio in true):>14}{f'{low:.2f} … {high:.2f}':>16}"
            print(f"{way.__name__:10}{frames:7}{cells}{valleys:8}{spent:9.2f}", flush=True)


def memory(checkpoint: bool) -> None:
    """Print the extra memory of one gradient of 150 frames, in a process of its own."""
    sheet = replace(CHOSEN[1], counts=(40, 25, 1), frames=151).scene()
    stiffness = torch.tensor(60.0, dtype=torch.float64, requires_grad=True)
    sheet = sheet.with_values({"spring.stiffness": stiffness})
    sheet.rollout(2, substeps=80, checkpoint=checkpoint).points.sum().backward()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    sheet.rollout(substeps=80, checkpoint=checkpoint).points.square().sum().backward()
    more = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    print(f"1000 points, 150 frames of 80 substeps, checkpoint={checkpoint}: {more:.0f} MB more")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, nargs="+", default=[3, 10, 30, 75, 150])
    parser.add_argument("--memory", action="store_true")
    parser.add_argument("--checkpoint", choices=["yes", "no"])
    given = parser.parse_args()
    torch.set_num_threads(1)
    if given.checkpoint:
        memory(given.checkpoint == "yes")
        return
    for each in CHOSEN:
        table(each, given.frames)
    if given.memory:
        for answer in ("no", "yes"):
            subprocess.run([sys.executable, __file__, "--checkpoint", answer], check=True)


if __name__ == "__main__":
    main()
