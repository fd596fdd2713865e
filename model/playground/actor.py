"""A twin on the stage: it moves, and is built anew when the user changes it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Float, Float32, Float64
from torch import Tensor

from model.bundle import TwinBundle
from model.gap.carried import CATALOGUE, carrying
from model.playground.edit import edited
from model.playground.grip import Grip
from model.playground.settings import Settings
from model.playground.stepper import Stepper
from model.simulator.system import State
from model.types import Array


class Actor:
    """One twin in motion.

    Args:
        name: What to call it on the stage; empty where it is alone.
        bundle: The twin as it came.
        interval: Of a frame [s].
        shift: Where it is shown, from where it is [m].
    """

    def __init__(
        self, name: str, bundle: TwinBundle, interval: float, shift: tuple[float, float, float] = (0, 0, 0)
    ) -> None:
        """See the class."""
        self.name, self.bundle, self._interval = name, bundle, interval
        self.shift: Float64[Array, " 3"] = np.array(shift, np.float64)
        self.times = motion_times(bundle)
        self.idle: tuple[str, ...] = ()
        """Effects that cannot act as things are."""
        self.substeps = 0
        """Of the last frame."""
        self._stepper: Stepper | None = None
        self._motion: Tensor | None = None
        self._mine = 0
        self.state = State(torch.as_tensor(bundle.topology.points), torch.zeros(bundle.topology.points.shape))

    @property
    def positions(self) -> Float32[Array, "N 3"]:
        """Where the points are [m]."""
        positions: Float32[Array, "N 3"] = self.state.positions.numpy()
        return positions

    def rest(self) -> None:
        """Put it back to rest; what its laws remembered is forgotten. It has to be built anew."""
        points = torch.as_tensor(self.bundle.topology.points)
        self.state, self._stepper = State(points, torch.zeros_like(points)), None

    def build(self, settings: Settings, hand: bool, grips: Sequence[Grip], moment: float) -> None:
        """Make its simulator.

        Args:
            settings: Its mechanics.
            hand: The hand of the clip holds it.
            grips: What the user holds it by.
            moment: Of the recorded motion [s].

        Raises:
            InputError: an effect that the twin carries has unusable values.
        """
        holding = [grip for grip in grips if grip.holds]
        bundle, controls = _held(edited(self.bundle, settings), hand, holding)
        world = replace(bundle, effects=()).world(self.times, controls)
        self.idle = tuple(r.name for r in bundle.effects if CATALOGUE[r.name]().unable(world) is not None)
        able = tuple(record for record in bundle.effects if record.name not in self.idle)
        if able:
            world = carrying(world, able)
        self._mine = sum(len(grip.points) for grip in holding)
        self._motion = None if world.controls is None else world.controls.to(self.state.positions)
        self._stepper = Stepper(world.simulator, self.state, self._places(moment, grips), self._interval)
        self.state = self._stepper.state

    def advance(self, moment: float, grips: Sequence[Grip]) -> None:
        """Move on by a frame.

        Args:
            moment: Of the recorded motion [s], at the end of the frame.
            grips: At the end of the frame.

        Raises:
            SimulationDiverged: its state is not finite.
        """
        assert self._stepper is not None
        self.substeps = self._stepper.advance(self._places(moment, grips), self._interval)
        self.state = self._stepper.state

    def hand_places(self, moment: float) -> Float64[Array, "c 3"]:
        """Where the hand of the clip is at `moment` [s] of its motion [m]; empty where it does not hold."""
        held = 0 if self._motion is None else self._motion.shape[1] - self._mine
        places: Float64[Array, "c 3"] = np.zeros((0, 3))
        return self._at(moment)[:held].double().numpy() if held else places

    def _places(self, moment: float, grips: Sequence[Grip]) -> Float[Tensor, "c 3"] | None:
        """Where all its controllers are: those of the clip, then those of the user."""
        if self._motion is None:
            return None
        places = self._at(moment).clone()
        if self._mine:
            mine = np.concatenate([grip.places for grip in grips if grip.holds])
            places[-self._mine :] = torch.as_tensor(mine).to(places)
        return places

    def _at(self, moment: float) -> Float[Tensor, "c 3"]:
        """The motion that was built, between its frames."""
        assert self._motion is not None
        after = int(np.searchsorted(self.times, moment, side="right").clip(1, len(self.times) - 1))
        begin, end = self.times[after - 1], self.times[after]
        share = float(np.clip((moment - begin) / (end - begin), 0.0, 1.0))
        return torch.lerp(self._motion[after - 1], self._motion[after], share)


def motion_times(bundle: TwinBundle) -> Float64[Array, " T"]:
    """Times of the recorded motion [s]; two where there is none."""
    frames = 2 if bundle.controls is None else max(2, len(bundle.controls))
    times: Float64[Array, " T"] = np.arange(frames, dtype=np.float64) / (bundle.manifest.source.fps or 30.0)
    return times


def _held(
    bundle: TwinBundle, hand: bool, grips: Sequence[Grip]
) -> tuple[TwinBundle, Float32[Array, "T C 3"] | None]:
    """The twin held by the clip's hand, if it holds, and by the user; and the motion of all of these [m]."""
    topology, count = bundle.topology, len(motion_times(bundle))
    points, springs = topology.controller_points, topology.controller_springs
    lengths, stiffness = topology.controller_rest_length, bundle.parameters.controller_stiffness
    if not hand:
        points, springs, lengths, stiffness = points[:0], springs[:0], lengths[:0], stiffness[:0]
    motion = points[None].repeat(count, 0)
    if hand and bundle.controls is not None:
        motion = bundle.controls[np.minimum(np.arange(count), len(bundle.controls) - 1)]
    for grip in grips:
        first, places = len(points), grip.places.astype(np.float32)
        pairs = np.stack([np.arange(first, first + len(grip.points)), grip.points], axis=1)
        points, springs = np.concatenate([points, places]), np.concatenate([springs, pairs.astype(np.int32)])
        lengths = np.concatenate([lengths, np.zeros(len(grip.points), np.float32)])
        stiffness = np.concatenate([stiffness, grip.stiffness.astype(np.float32)])
        motion = np.concatenate([motion, places[None].repeat(count, 0)], axis=1)
    held = replace(
        topology, controller_points=points, controller_springs=springs, controller_rest_length=lengths
    )
    parameters = replace(bundle.parameters, controller_stiffness=stiffness)
    return replace(bundle, topology=held, parameters=parameters), motion if len(points) else None
