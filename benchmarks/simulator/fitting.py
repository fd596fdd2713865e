"""Fits from the same starts at the same cost: all frames at once, growing horizons, gradients, differences.

Run: `python benchmarks/simulator/fitting.py [--starts 4] [--evaluations 60]`

A planted object moves for a second at 30 frames per second, seen with 1 mm of noise, a fifth hidden. Each fit
looks for stiffness, dashpot and drag, or friction and the velocity of a throw, from starts that are off by a
factor (one standard deviation of its logarithm: 1). The truth is rolled out at three times the substeps. A
fit has succeeded when its loss (mean square residual in units of noise) is below 1.5.
"""

import argparse
from dataclasses import dataclass, replace

import numpy as np
import torch

from model.simulator.build import build_simulator
from model.simulator.fitting.fit import fit
from model.simulator.fitting.plan import Plan
from model.simulator.fitting.scene import Scene
from model.simulator.fitting.target import Target
from model.simulator.fitting.unknown import seek
from model.simulator.system import State

FPS, FRAMES, NOISE, HIDDEN = 30.0, 31, 1e-3, 0.2
HELD = ("spring.stiffness", "dashpot.dashpot_damping", "drag.drag_rate")
THROWN = ("ground.friction", "spring.stiffness", "state.velocities")


@dataclass(frozen=True)
class Object:
    """What moves, and what is looked for."""

    name: str
    counts: tuple[int, int, int]
    reach: float
    damping: float
    drag: float
    thrown: bool = False
    frames: int = FRAMES

    def scene(self) -> Scene:
        """The truth."""
        grid = np.stack(np.meshgrid(*[np.arange(n) for n in self.counts], indexing="ij"), -1)
        points = 0.03 * grid.reshape(-1, 3) + [0.0, 0.0, 0.01]
        apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
        pairs = np.argwhere(np.triu((apart < self.reach * 0.03) & (apart > 0)))
        held = np.arange(0 if self.thrown else self.counts[1] * self.counts[2])
        simulator = build_simulator(
            points=points,
            mass=np.full(len(points), 0.003),
            springs=pairs,
            rest_length=apart[pairs[:, 0], pairs[:, 1]],
            stiffness=60.0,
            controller_springs=np.stack([held, held], 1),
            controller_rest_length=np.zeros(len(held)),
            controller_stiffness=300.0,
            controller_points=points[held],
            dashpot_damping=self.damping,
            drag_rate=self.drag,
            friction=0.4,
            ground_height=0.0 if self.thrown else None,
            dtype=torch.float64,
        )
        scene = Scene(simulator, np.arange(self.frames) / FPS)
        if not self.thrown:
            return scene
        rest = simulator.rest_state()
        thrown = torch.tensor([0.8, 0.0, -0.5], dtype=torch.float64).expand_as(rest.positions)
        return replace(scene, state=State(rest.positions, thrown))


OBJECTS = (
    Object("chain, underdamped", (8, 1, 1), 1.1, 0.001, 0.02),
    Object("sheet, damped", (5, 4, 1), 1.5, 0.05, 2.0),
    Object("sheet, underdamped", (5, 4, 1), 1.5, 0.001, 0.02),
    Object("block, thrown on the ground", (3, 3, 3), 1.8, 0.1, 0.5, thrown=True, frames=11),
)


def plans(evaluations: int, frames: int) -> dict[str, Plan]:
    """The ways to spend them."""
    whole = {"horizons": (frames - 1,), "refine": 1.0}
    return {
        "L-BFGS, all frames": Plan(evaluations, method="lbfgs", **whole),
        "L-BFGS, growing": Plan(evaluations, method="lbfgs"),
        "Gauss-Newton, all frames": Plan(evaluations, method="gauss_newton", **whole),
        "Gauss-Newton, growing": Plan(evaluations, method="gauss_newton"),
    }


def see(scene: Scene) -> Target:
    """The scene as a camera would."""
    with torch.no_grad():
        points = scene.rollout(substeps=3 * max(scene.rollout(2).substeps)).points
    rng = np.random.default_rng(0)
    seen = points + torch.from_numpy(rng.normal(0.0, NOISE, points.shape))
    seen[torch.from_numpy(rng.random(points.shape[:2]) < HIDDEN)] = torch.nan
    return Target(seen, noise=NOISE)


def start(scene: Scene, name: str, rng: np.random.Generator):
    """An unknown, off its true value."""
    if name == "state.velocities":
        return seek(scene, name, start=torch.from_numpy(rng.normal([0.8, 0.0, -0.5], 0.4)), scale=0.5)
    truth = float(scene.value(name).detach().reshape(-1)[0])
    begin = truth * float(np.exp(rng.normal()))
    top = {"spring.stiffness": 1e4, "ground.friction": 2.0}.get(name, 100 * truth)
    return seek(scene, name, start=begin, bounds=(0.0 if name != HELD[0] else 0.1, top))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=4)
    parser.add_argument("--evaluations", type=int, default=60)
    given = parser.parse_args()
    torch.set_num_threads(1)
    print(f"{given.starts} starts each, {given.evaluations} evaluations (a rollout alone counts a third)")
    print(f"{'object':28} {'way':26} succeeded  median loss  worst  error of stiffness  cost  verdicts")
    for each in OBJECTS:
        scene = each.scene()
        target = see(scene)
        for way, plan in plans(given.evaluations, each.frames).items():
            rng, found = np.random.default_rng(1), []
            for _ in range(given.starts):
                unknowns = [start(scene, name, rng) for name in (THROWN if each.thrown else HELD)]
                found.append(fit(scene, unknowns, target, plan))
            losses = np.array([result.loss for result in found])
            off = np.median([abs(np.log(float(r.values[HELD[0]]) / 60.0)) for r in found])
            cost = np.mean([result.evaluations for result in found])
            said = ", ".join(
                f"{sum(r.verdict.outcome == kind for r in found)} {kind}"
                for kind in ("converged", "stalled", "budget")
                if any(r.verdict.outcome == kind for r in found)
            )
            print(
                f"{each.name:28} {way:26} {(losses < 1.5).sum():3} of {given.starts:<3} "
                f"{np.median(losses):11.3g} {losses.max():8.3g} {off:16.1%} {cost:8.0f}  {said}",
                flush=True,
            )


if __name__ == "__main__":
    main()
