"""The twin bundle (contract 4): one zip with everything needed to move, draw and question a twin."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from jaxtyping import Float32
from pydantic import BaseModel

from model.archive import MEBIBYTE, read_archive, write_archive
from model.errors import InputError
from model.files import replacing
from model.parameters import decode_parameters, encode_parameters
from model.ply import decode_ply, encode_ply
from model.schema import (
    BundleManifest,
    EffectRecord,
    EffectRecords,
    PartRecord,
    PartRecords,
    read_json,
    write_json,
)
from model.system import System, decode_system, encode_system
from model.types import (
    Array,
    Camera,
    Gaussians,
    Parameters,
    Topology,
)

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
