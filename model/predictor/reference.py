"""Twins of reference: how a topology would have moved under the recorded hand, made of known stuff."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float32, Float64

from model.encoders.motion import GLOBALS, ReferenceMotion
from model.encoders.response import explain, spreads_before
from model.encoders.seen import across
from model.predictor.affordable import affordable
from model.predictor.lattice import lattice_shares, sprung
from model.predictor.prior_means import dashpot_damping, grip_stiffness
from model.scenes.case import Anchors
from model.scenes.replay import observed, topology_simulator
from model.simulator.divergence import SimulationDiverged
from model.simulator.pace import StabilityWarning
from model.simulator.simulator import Simulator
from model.types import Array, Camera, Observation, ShapeClass, Topology

SWEEP = np.log([6.0, 28.0, 134.0, 634.0, 3000.0])
"""ln E/ρ [m²/s²] of the twins of one modulus: from the softest plush to what explicit steps still afford."""
STEP = 0.8
"""By how much the logarithm of a constant is changed at a time."""
ROUNDS = 2
"""How often the constants are varied: around the twin of one modulus, then around what that says."""
FARTHEST = 1.2
"""The largest change of a logarithm from one round to the next."""
DAMPING_RATIO = 0.1
DRAG_RATE, FRICTION, RESTITUTION = 0.6, 0.5, 0.25
"""[1/s], [1], [1]: in the middle of what the ten materials have."""
MOST_WORK = 900_000
"""Frames times springs of a rollout: longer clips of large twins are compared in their first frames alone."""


@dataclass(frozen=True)
class _Stuff:
    """What a body is made of."""

    log_modulus: Float64[Array, " K"]
    """Of each part: ln E/ρ [m²/s²]."""
    values: Float64[Array, " 4"]
    """Of `GLOBALS`: ln, ln, ln, logit."""


def compared_frames(springs: int, frames: int) -> int:
    """How many of `frames` frames of a twin of so many springs are compared with the twins of reference."""
    return max(2, min(frames, MOST_WORK // max(springs, 1)))


def reference_motion(
    topology: Topology,
    shape_class: ShapeClass,
    anchors: Anchors,
    observation: Observation,
    camera: Camera | None,
) -> ReferenceMotion:
    """Simulate twins of this topology that differ from each other in one constant.

    First some of one modulus throughout. Between the two of them that move most like what was seen lies the
    first base; from it one constant after the other is changed, which says where a better base lies, and
    that is varied likewise. Nothing here depends on a belief about materials, and the number of rollouts is
    fixed by the number of parts.

    Args:
        topology: Points, masses, springs; how a uniform body's springs share its modulus follows from it.
        shape_class: See `lattice_stiffness`.
        anchors: Where the observed points hang.
        observation: All of it is used.
        camera: Given where depth along its lines of sight was guessed; then it does not count.
    """
    bench = _Bench(topology, shape_class, anchors, observation)
    rest = observed(anchors, torch.as_tensor(topology.points)[None]).numpy().astype(np.float32)
    still = np.repeat(rest, len(observation.times), axis=0)
    sweep_log = np.minimum(SWEEP, bench.log_ceiling)
    moved = list[Float32[Array, "T N 3"]]()
    for place, value in enumerate(sweep_log):
        again = place > 0 and value == sweep_log[place - 1]
        moved.append(moved[-1] if again else bench.roll([bench.uniform(value)], still)[0])
    sweep = np.stack(moved)
    base_log = _between(sweep_log, sweep, observation.points, camera)
    base = bench.uniform(base_log)
    varied, steps = bench.vary(base, sweep[int(np.abs(sweep_log - base_log).argmin())])
    for _ in range(ROUNDS - 1):
        base = bench.nearer(base, _explained(observation.points, varied, steps, rest[0], camera))
        varied, steps = bench.vary(base, varied[0])
    return ReferenceMotion(
        sweep_log_modulus=sweep_log,
        sweep=sweep,
        base_log_modulus=base.log_modulus,
        base=varied[0],
        base_globals=base.values,
        varied=varied[1:],
        steps=steps,
    )


class _Bench:
    """Rolls a topology out under recorded controls, of whatever stuff."""

    def __init__(
        self, topology: Topology, shape_class: ShapeClass, anchors: Anchors, observation: Observation
    ) -> None:
        self.topology, self.anchors, self.seen = topology, anchors, observation
        self.parts = int(topology.part.max()) + 1
        self.mass = np.bincount(topology.part, topology.mass.astype(np.float64), minlength=self.parts)
        self.shares = lattice_shares(topology, self.parts, shape_class)
        hard = self._stiffness(np.full(self.parts, SWEEP[-1]))
        limit = affordable(topology, hard, grip_stiffness(topology, hard), self._dashpot(hard))
        self.log_ceiling = float(SWEEP[-1] + np.log(limit.stiffness))

    def uniform(self, log_modulus: float) -> _Stuff:
        """One modulus throughout, middling constants."""
        modulus = np.full(self.parts, log_modulus)
        dashpot = self._dashpot(self._stiffness(modulus))
        logit = np.log(RESTITUTION / (1.0 - RESTITUTION))
        return _Stuff(modulus, np.array([np.log(dashpot), np.log(DRAG_RATE), np.log(FRICTION), logit]))

    def vary(
        self, base: _Stuff, otherwise: Float32[Array, "T N 3"]
    ) -> tuple[Float32[Array, "V1 T N 3"], Float64[Array, " V"]]:
        """The base, then it with each constant changed; by how much.

        Moduli and the dashpot are lowered, so that no twin needs more substeps than the base.

        Args:
            base: What is changed.
            otherwise: How all of them move [m] should their simulation break.
        """
        steps = np.full(self.parts + len(GLOBALS), STEP)
        steps[: self.parts + 1] *= -1.0
        if self.seen.ground_height is None:
            steps[-2:] = 0.0
        acting = np.flatnonzero(steps)
        changes = np.concatenate([np.zeros((1, len(steps))), np.diag(steps)[acting]])
        changed = [
            _Stuff(base.log_modulus + change[: self.parts], base.values + change[self.parts :])
            for change in changes
        ]
        rolled = self.roll(changed, otherwise)
        moved = np.repeat(rolled[:1], 1 + len(steps), axis=0)
        moved[1 + acting] = rolled[1:]
        return moved, steps

    def nearer(self, base: _Stuff, change: Float64[Array, " V"]) -> _Stuff:
        """The base changed, but not far beyond what its responses cover, and within what can be afforded."""
        near = np.clip(change, -FARTHEST, FARTHEST)
        modulus = np.clip(base.log_modulus + near[: self.parts], SWEEP[0] - FARTHEST, self.log_ceiling)
        values = base.values + near[self.parts :]
        stiffness = self._stiffness(modulus)
        held = grip_stiffness(self.topology, stiffness)
        limit = affordable(self.topology, stiffness, held, float(np.exp(values[0])))
        values[0] += np.log(limit.dashpot)
        return _Stuff(modulus + np.log(limit.stiffness), values)

    def roll(self, stuffs: Sequence[_Stuff], otherwise: Float32[Array, "T N 3"]) -> Float32[Array, "B T N 3"]:
        """How the observed points of each move [m]; `otherwise` should a simulation break under its hand."""
        controls = torch.as_tensor(self.seen.controllers) if self.seen.controllers.shape[1] else None
        with torch.no_grad(), warnings.catch_warnings():
            warnings.simplefilter("ignore", StabilityWarning)
            try:
                points = self._simulator(stuffs).rollout(None, controls, times=self.seen.times).points
            except SimulationDiverged:
                return np.repeat(otherwise[None], len(stuffs), axis=0)
            moved = observed(self.anchors, points).numpy().astype(np.float32)
        return np.ascontiguousarray(moved.swapaxes(0, 1))

    def _simulator(self, stuffs: Sequence[_Stuff]) -> Simulator:
        """All of them in one, side by side as a batch."""
        topology = self.topology
        stiffness = np.stack([self._stiffness(stuff.log_modulus) for stuff in stuffs])
        values = np.stack([stuff.values for stuff in stuffs])
        dashpot, drag, friction = (np.exp(values[:, column, None]) for column in range(3))
        return topology_simulator(
            topology,
            self.seen,
            stiffness=stiffness,
            controller_stiffness=np.stack([grip_stiffness(topology, each) for each in stiffness]),
            dashpot_damping=dashpot,
            drag_rate=drag,
            friction=friction,
            restitution=1.0 / (1.0 + np.exp(-values[:, 3, None])),
        )

    def _stiffness(self, log_modulus: Float64[Array, " K"]) -> Float64[Array, " E"]:
        """Springs of a body with these specific moduli [N/m]: volume × modulus is mass × E/ρ."""
        ends = self.topology.part[self.topology.springs]
        return sprung(self.shares, log_modulus, self.mass, ends)

    def _dashpot(self, stiffness: Float64[Array, " E"]) -> float:
        return dashpot_damping(self.topology, stiffness, DAMPING_RATIO)


def _explained(
    seen: Float32[Array, "T N 3"],
    varied: Float32[Array, "V1 T N 3"],
    steps: Float64[Array, " V"],
    rest: Float32[Array, "N 3"],
    camera: Camera | None,
) -> Float64[Array, " V"]:
    """Changes of the base's constants that explain where points were seen."""
    known = np.isfinite(seen).all(axis=-1)
    places = np.where(known[..., None], seen, rest)
    scale = np.where(steps == 0.0, 1.0, steps)[:, None, None, None]
    off, response = (
        np.where(known[..., None], across(values, places, camera), 0.0)
        for values in (places - varied[0], (varied[1:] - varied[0]) / scale)
    )
    change: Float64[Array, " V"] = explain(
        off, response, known, spreads_before(len(steps) - len(GLOBALS))
    ).change
    return change


def _between(
    logs: Float64[Array, " R"],
    sweep: Float32[Array, "R T N 3"],
    seen: Float32[Array, "T N 3"],
    camera: Camera | None,
) -> float:
    """The modulus at which the straight way from one twin to the next comes nearest to what was seen."""
    off = across(seen - sweep, seen, camera)
    known: Bool[Array, "T N"] = np.isfinite(off[0]).all(axis=-1)
    off = np.where(known[..., None], off, 0.0).astype(np.float64)
    best, least = float(logs[0]), np.inf
    for soft in range(len(logs) - 1):
        way = off[soft] - off[soft + 1]
        length = float((way**2).sum())
        share = float(np.clip((off[soft] * way).sum() / length, 0.0, 1.0)) if length > 0.0 else 0.0
        error = float(((off[soft] - share * way) ** 2).sum())
        if error < least:
            best, least = float(logs[soft] + share * (logs[soft + 1] - logs[soft])), error
    return best
