"""The twin bundle (contract 4): one zip with everything needed to move, draw and question a twin."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from jaxtyping import Float32, Float64
from pydantic import BaseModel

from model.errors import InputError
from model.formats.archive import MEBIBYTE, read_archive, write_archive
from model.formats.files import replacing
from model.formats.parameters import decode_parameters, encode_parameters, gravity, ground_height, scalar
from model.formats.ply import decode_ply, encode_ply
from model.formats.system import System, decode_system, encode_system
from model.schema import (
    BundleManifest,
    EffectRecord,
    EffectRecords,
    PartRecord,
    PartRecords,
    read_json,
    write_json,
)
from model.types import Array, Camera, Gaussians, Parameters, Topology, Trajectory
from model.units import PROPERTY_UNITS, check_unit

if TYPE_CHECKING:
    from model.gap.world import World
    from model.simulator.simulator import Simulator

LIMITS: Mapping[str, int] = {
    "twin.json": 16 * MEBIBYTE,
    "gaussians.ply": 512 * MEBIBYTE,
    "system.safetensors": 512 * MEBIBYTE,
    "parameters.json": 1 * MEBIBYTE,
    "parts.json": 64 * MEBIBYTE,
    "effects.json": 64 * MEBIBYTE,
    "preview.mp4": 256 * MEBIBYTE,
}
"""The members of a bundle, in their order, and the largest size of each that is read [bytes]."""
OPTIONAL = ("effects.json", "preview.mp4")

Payload = TypeVar("Payload", bound=BaseModel)


@dataclass(frozen=True)
class TwinBundle:
    """A twin: what it looks like, how it moves, and how both were found."""

    manifest: BundleManifest
    gaussians: Gaussians
    topology: Topology
    parameters: Parameters
    parts: tuple[PartRecord, ...] = ()
    controls: Float32[Array, "T C 3"] | None = None
    """The recorded motion of the controllers [m]; frame 0 belongs to the rest state."""
    effects: tuple[EffectRecord, ...] = ()
    preview: bytes | None = None
    """An MP4: the input beside the rollout."""

    def save(self, path: Path) -> None:
        """Write the bundle; `path` then holds all of it or what it held before.

        Equal bundles give equal bytes. What was written is read back and verified before it takes the place.

        Raises:
            InputError: nothing can be written at `path`.
            RuntimeError: this bundle breaks the contract.
        """
        with replacing(path) as temporary:
            write_archive(temporary, self._members())
            try:
                TwinBundle.load(temporary)
            except InputError as error:
                raise RuntimeError(f"refusing to write a bundle that breaks the contract: {error}") from error

    @classmethod
    def load(cls, path: Path) -> "TwinBundle":
        """Read and verify a bundle, whoever wrote it.

        Raises:
            InputError: the bundle breaks the contract; the message names the file, the member and the key.
        """
        members = read_archive(path, LIMITS)
        for name in LIMITS:
            if name not in members and name not in OPTIONAL:
                raise InputError(f"{path.name}: {name} is missing")

        def json(name: str, kind: type[Payload]) -> Payload:
            return read_json(members[name], kind, f"{path.name}: {name}")

        manifest = json("twin.json", BundleManifest)
        system = decode_system(members["system.safetensors"], f"{path.name}: system.safetensors")
        gaussians = decode_ply(members["gaussians.ply"], f"{path.name}: gaussians.ply")
        parameters = decode_parameters(
            members["parameters.json"],
            system.stiffness,
            system.controller_stiffness,
            f"{path.name}: parameters.json",
        )
        bundle = cls(
            manifest=manifest,
            gaussians=gaussians,
            topology=system.topology,
            parameters=parameters,
            parts=json("parts.json", PartRecords).root,
            controls=system.controls,
            effects=json("effects.json", EffectRecords).root if "effects.json" in members else (),
            preview=members.get("preview.mp4"),
        )
        bundle._check_counts(path.name)
        bundle._check_units(path.name)
        return bundle

    @classmethod
    def verify(cls, path: Path) -> None:
        """Check a bundle from the first byte to the last index.

        Raises:
            InputError: the bundle breaks the contract; the message names the file, the member and the key.
        """
        cls.load(path)

    @property
    def camera(self) -> Camera | None:
        """The camera of the clip, if the manifest has all of it."""
        record = self.manifest.source.camera
        width, height = self.manifest.source.width, self.manifest.source.height
        if record is None or record.intrinsics is None or record.world_from_camera is None:
            return None
        width, height = record.width or width, record.height or height
        if width is None or height is None:
            return None
        intrinsics, pose = (
            np.array(record.intrinsics, np.float64),
            np.array(record.world_from_camera, np.float64),
        )
        return Camera(intrinsics, pose, width, height)

    def simulator(self) -> "Simulator":
        """The simulator of this twin, with its own parameters and the effects that it carries.

        An effect of the hand (`actuation_delay`) changes the motion that is given to it, so `rollout` alone
        has it.

        Raises:
            InputError: an effect of the twin cannot act in it.
        """
        return self.world(np.arange(2.0)).simulator

    def world(self, times: Float64[Array, " T"], controls: Float32[Array, "T C 3"] | None = None) -> "World":
        """This twin under a motion of its controllers, with its effects; every mass point is seen.

        Args:
            times: Of the frames [s].
            controls: Where the controllers are [m]; None: they stay where they are at rest.

        Raises:
            InputError: an effect of the twin cannot act in it.
        """
        import torch  # takes a second

        from model.gap.sight import Sight
        from model.gap.world import World

        points = len(self.topology.points)
        everything = Sight(torch.arange(points)[:, None], torch.ones((points, 1)))
        motion = None
        if len(self.topology.controller_springs):
            held = self.topology.controller_points[None].repeat(len(times), 0)
            motion = torch.from_numpy(held if controls is None else controls)
        world = World(self._plain_simulator(), everything, times, motion, ground_height(self.parameters))
        if not self.effects:
            return world
        from model.gap.carried import carrying

        return carrying(world, self.effects)

    def _plain_simulator(self) -> "Simulator":
        """The simulator without effects."""
        from model.simulator.build import build_simulator

        topology, parameters = self.topology, self.parameters
        held = len(topology.controller_springs) > 0
        return build_simulator(
            points=topology.points,
            mass=topology.mass,
            springs=topology.springs,
            rest_length=topology.rest_length,
            stiffness=parameters.stiffness,
            controller_springs=topology.controller_springs if held else None,
            controller_rest_length=topology.controller_rest_length if held else None,
            controller_stiffness=parameters.controller_stiffness if held else None,
            controller_points=topology.controller_points if held else None,
            dashpot_damping=scalar(parameters, "dashpot_damping", 0.0),
            drag_rate=scalar(parameters, "drag_rate", 0.0),
            friction=scalar(parameters, "friction", 0.0),
            restitution=scalar(parameters, "restitution", 0.0),
            collision_distance=scalar(parameters, "collision_distance", 0.0),
            bending_decay=scalar(parameters, "bending_decay", 0.0),
            gravity=gravity(parameters),
            ground_height=ground_height(parameters),
        )

    def rollout(
        self,
        controls: Float32[Array, "T C 3"] | None = None,
        progress: Callable[[float], None] | None = None,
        *,
        times: Float64[Array, " T"] | None = None,
        substeps: int | None = None,
    ) -> Trajectory:
        """Move the twin from rest.

        Args:
            controls: Where the controllers are [m]; None: the recorded motion, or, where there is none, the
                controllers stay where they are for as long as the clip goes on after its keyframe.
            progress: Called with the share of the frames done, 0..1.
            times: Of the frames [s]; None: the frame rate of the clip.
            substeps: Per frame; None: as many as stability asks for.

        Raises:
            InputError: the frame rate is unknown, the controls do not fit, an effect cannot act, or the
                motion diverges.
        """
        import torch

        controls = self.controls if controls is None else controls
        if times is None:
            times = self._times(None if controls is None else len(controls))

        def report(done: int, whole: int) -> None:
            if progress is not None:
                progress(done / whole)

        with torch.no_grad():
            world = self.world(times, controls)
            rollout = world.simulator.rollout(
                controls=world.controls, times=times, substeps=substeps, progress=report
            )
        most = float(max(rollout.substeps, default=0))
        return Trajectory(times, rollout.points.float().numpy(), {"substeps_per_frame": most})

    def _times(self, frames: int | None) -> Float64[Array, " T"]:
        """Times [s] of `frames` frames; None: of the clip's from its keyframe on, else of one second."""
        source = self.manifest.source
        if source.fps is None:
            raise InputError("twin.json: source.fps is missing: give controls with times")
        if frames is None:
            recorded = None if source.frames is None else source.frames - (source.keyframe or 0)
            frames = 1 + round(source.fps) if recorded is None else max(1, recorded)
        times: Float64[Array, " T"] = np.arange(frames, dtype=np.float64) / source.fps
        return times

    def _members(self) -> dict[str, bytes]:
        """The files of the bundle, in the order of the contract."""
        stiffness, controller_stiffness = self.parameters.stiffness, self.parameters.controller_stiffness
        system = System(self.topology, stiffness, controller_stiffness, self.controls)
        members = {
            "twin.json": write_json(self.manifest),
            "gaussians.ply": encode_ply(self.gaussians),
            "system.safetensors": encode_system(system),
            "parameters.json": encode_parameters(self.parameters),
            "parts.json": write_json(list(self.parts)),
        }
        if self.effects:
            members["effects.json"] = write_json(list(self.effects))
        if self.preview is not None:
            members["preview.mp4"] = self.preview
        return members

    def _check_units(self, name: str) -> None:
        """Check what the parts are believed to be like; parameters are checked where they are read."""
        for number, part in enumerate(self.parts):
            for known, unit in PROPERTY_UNITS.items():
                if known in part.prior:
                    where = f"{name}: parts.json: {number}.prior.{known}.unit"
                    check_unit(part.prior[known].unit, unit, where)

    def _check_counts(self, name: str) -> None:
        """Check the members against each other."""
        bound, count = len(self.topology.binding_index), len(self.gaussians)
        if bound != count:
            raise InputError(
                f"{name}: system.safetensors: binding_index: expected a row for each of the {count} "
                f"Gaussians, found {bound}"
            )
        last = int(self.topology.part.max())
        if self.parts and last >= len(self.parts):
            raise InputError(
                f"{name}: system.safetensors: part: expected labels 0..{len(self.parts) - 1} of parts.json, "
                f"found {last}"
            )
        points = len(self.topology.points)
        for i, effect in enumerate(self.effects):
            if effect.acts_on is not None and len(effect.acts_on) != points:
                raise InputError(
                    f"{name}: effects.json: {i}.acts_on: expected a number for each of the {points} points, "
                    f"found {len(effect.acts_on)}"
                )
            from model.gap.carried import values_of  # reaches torch, which twins without effects do without

            values_of(effect, f"{name}: effects.json: {i}")
