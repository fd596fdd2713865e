"""A twin as the folder that PhysTwin's interactive playground reads, where the twin meets its rules."""

import io
import json
import pickle
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from jaxtyping import Bool, Float64

from model.errors import InputError
from model.exports.base import Exporter
from model.exports.folder import write_folder
from model.exports.mechanics import Mechanics, mechanics_of, point_colors, roll
from model.exports.phystwin_rule import SPARE, Rule, spring_rule
from model.exports.readme import write_readme
from model.formats.ply import encode_ply
from model.types import Array, Gaussians

if TYPE_CHECKING:
    from model.bundle import TwinBundle

STIFFEST = 1e5
"""Largest stiffness per strain that its simulator takes [N] per kilogram of a point."""
GRAVITY = 9.8
"""What its simulator has, downwards [m/s²]."""
STEP = 5e-5
"""Of its simulator [s], 667 a frame at 30 frames per second."""
ALIKE = 1e-3
"""Relative difference up to which numbers count as equal."""
ALOFT = 5.0
"""Height [m] of an object without ground above the plane z = 0, which is always there."""
FLIP = np.array([1.0, -1.0, -1.0])
"""z up to z down: half a turn about x."""
TURNED = np.array([-1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1], np.float32)
"""What that half turn makes of the real spherical harmonics of degree 1, 2, 3 in the order of a 3DGS file:
the sign of x y z powers with an odd number of y and z."""
HARMONICS = 45
LEFT_OUT = 0.0
"""Stiffness per strain of springs that its simulator skips, dashpots as well: it takes the logarithm, and
tests whether the exponential of that is above 0 (`eval_springs` of its spring_mass_warp.py)."""
SPLATS = "gaussian_output/{}/init=hybrid_iso=True_ldepth=0.001_lnormal=0.0_laniso_0.0_lseg=1.0/point_cloud"
CASE = "twin"


class PhystwinExporter(Exporter):
    """A folder to be laid over a checkout of PhysTwin; the case is called `twin`.

    Its playground makes the springs anew by a rule: the nearest neighbours, so many at most, within a radius.
    What the rule makes and the twin has not gets stiffness 0: its simulator leaves such springs out. It has
    mass 1 at every point, stiffness Y per strain (k = Y / L), isotropic Gaussians, z down. All masses,
    stiffnesses and dashpots are divided by the mean mass of a point, which leaves the motion as it is where
    masses are equal; where they are not, and where Gaussians are flat, `losses` says what that costs. A twin
    that breaks another of its rules is refused.

    Reference:
        Jiang et al. (2025), PhysTwin: Physics-informed reconstruction and simulation of deformable objects
        from videos, arXiv:2503.17973, and its code (Jianghanxiao/PhysTwin, interactive_playground.py).
    """

    name: ClassVar[str] = "phystwin"

    def __call__(self, twin: "TwinBundle", out: Path) -> list[Path]:
        """Write the folder `out`."""
        mechanics = mechanics_of(twin)
        _check(mechanics)
        mass = float(mechanics.mass.mean())
        points, hands = len(mechanics.points), mechanics.edges[mechanics.spring_count :]
        places = _down(mechanics.points, mechanics).astype(np.float32)
        held = _down(mechanics.controls[0], mechanics).astype(np.float32)
        rule = spring_rule(places, mechanics.edges[: mechanics.spring_count])
        grip = spring_rule(places, hands[:, ::-1] - [points, 0], held)
        own = mechanics.stiffness * mechanics.rest_length / mass
        if not ((own > 0) & (own <= STIFFEST)).all():
            raise InputError(
                f"phystwin: stiffness times length over mass reaches {own.max():.3g} N/kg, and its "
                f"simulator takes above 0 and up to {STIFFEST:g}"
            )
        hand = np.where(grip.order == SPARE, SPARE, mechanics.spring_count + grip.order)
        order = np.concatenate([rule.order, hand])
        strength = np.where(order == SPARE, LEFT_OUT, own[order])
        files = {
            f"data/different_types/{CASE}/final_data.pkl": _pickle(_observation(twin, mechanics)),
            f"data/different_types/{CASE}/calibrate.pkl": _pickle([_pose(twin, mechanics)]),
            f"data/different_types/{CASE}/metadata.json": _metadata(twin),
            f"experiments_optimization/{CASE}/optimal_params.pkl": _pickle(
                _options(mechanics, mass, rule, grip)
            ),
            f"experiments/{CASE}/train/best_0.pth": _checkpoint(mechanics, len(rule.order), strength),
            f"{SPLATS.format(CASE)}/iteration_10000/point_cloud.ply": encode_ply(_splats(twin, mechanics)),
            "README.md": _readme(twin, mechanics, self.losses(twin)).encode(),
        }
        return write_folder(out, files)

    def losses(self, twin: "TwinBundle") -> tuple[str, ...]:
        """Equal masses and round Gaussians as well, where the twin has others."""
        lost, mass = list(super().losses(twin)), twin.topology.mass
        if np.ptp(mass) > ALIKE * mass.mean():
            evened = replace(twin.topology, mass=np.full_like(mass, mass.mean()))
            whole, even = roll(twin).points, roll(replace(twin, topology=evened)).points
            apart = 1e3 * np.linalg.norm(whole - even, axis=-1)
            lost.append(
                f"{self.name}: points of the files are equally heavy: under the recorded motion that alone "
                f"moves them by {apart.mean():.2g} mm on average, {apart.max():.2g} mm at most"
            )
        if _flat(twin.gaussians).any():
            lost.append(f"{self.name}: the Gaussians of the files are round, as large as they were broad")
        return tuple(lost)


def _flat(gaussians: Gaussians) -> Bool[Array, " M"]:
    """Which are not isotropic."""
    flat: Bool[Array, " M"] = gaussians.scales.max(axis=1) > (1 + ALIKE) * gaussians.scales.min(axis=1)
    return flat


def _check(mechanics: Mechanics) -> None:
    """Refuse what its playground does otherwise."""
    gravity = np.array(mechanics.gravity)
    ends = np.concatenate([mechanics.points, mechanics.controllers])[mechanics.edges]
    apart = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    reasons = {
        "nothing is held, and its playground moves an object by its control points": not len(
            mechanics.controllers
        ),
        f"gravity is not {GRAVITY} m/s² downwards": bool(
            np.abs(gravity - [0, 0, -GRAVITY]).max() > 2 * ALIKE * GRAVITY
        ),
        "springs are stretched or pressed at rest, and its rest lengths are the distances at rest": bool(
            (np.abs(apart - mechanics.rest_length) > ALIKE * apart).any()
        ),
        "friction is above 2": mechanics.friction > 2,
        f"it steps at {STEP:g} s, and this twin needs {mechanics.needed:.3g} s": mechanics.needed < STEP,
    }
    for reason, broken in reasons.items():
        if broken:
            raise InputError(f"phystwin: {reason}")


def _down(places: Array, mechanics: Mechanics) -> Float64[Array, "*n 3"]:
    """World places [m] in its frame: z down, the ground at 0."""
    if mechanics.ground_height is None:
        floor = float(mechanics.points[:, 2].min()) - ALOFT
    else:
        floor = mechanics.ground_height
    moved: Float64[Array, "*n 3"] = (places.astype(np.float64) - [0.0, 0.0, floor]) * FLIP
    return moved


def _observation(twin: "TwinBundle", mechanics: Mechanics) -> dict[str, Array]:
    """`final_data.pkl`: the points in every frame of the rollout, as if they had been observed."""
    moved = _down(roll(twin).points, mechanics).astype(np.float32)
    frames, count = moved.shape[:2]
    return {
        "object_points": moved,
        "object_colors": np.repeat(point_colors(twin).astype(np.float32)[None], frames, axis=0),
        "object_visibilities": np.ones((frames, count), bool),
        "object_motions_valid": np.ones((frames, count), bool),
        "controller_points": _down(mechanics.controls, mechanics).astype(np.float32),
        "surface_points": np.zeros((0, 3), np.float32),
        "interior_points": np.zeros((0, 3), np.float32),
    }


def _pose(twin: "TwinBundle", mechanics: Mechanics) -> Float64[Array, "4 4"]:
    """Camera → its world: the clip's, or one that looks at the object from the front."""
    if twin.camera is not None:
        pose = twin.camera.world_from_camera.copy()
    else:
        middle, away = (
            mechanics.points.mean(axis=0),
            3.0 * float(np.ptp(mechanics.points, axis=0).max() or 0.1),
        )
        pose = np.eye(4)
        pose[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]  # looks along y, z up
        pose[:3, 3] = middle - [0.0, away, 0.0]
    pose[:3, 3] = _down(pose[:3, 3], mechanics)
    pose[:3, :3] = FLIP[:, None] * pose[:3, :3]
    return pose


def _metadata(twin: "TwinBundle") -> bytes:
    camera = twin.camera
    if camera is None:
        content = {"intrinsics": [[[430.0, 0, 424.0], [0, 430.0, 240.0], [0, 0, 1]]], "WH": [848, 480]}
    else:
        content = {"intrinsics": [camera.intrinsics.tolist()], "WH": [camera.width, camera.height]}
    return json.dumps(content).encode()


def _options(mechanics: Mechanics, mass: float, rule: Rule, grip: Rule) -> dict[str, float | int]:
    """`optimal_params.pkl`: what overrides its configuration."""
    return {
        "global_spring_Y": 3e3,
        "dashpot_damping": mechanics.dashpot_damping / mass,
        "drag_damping": mechanics.drag_rate,
        "collide_elas": mechanics.restitution,
        "collide_fric": mechanics.friction,
        "collide_object_elas": mechanics.restitution,
        "collide_object_fric": mechanics.friction,
        "collision_dist": mechanics.collision_distance,
        "object_radius": rule.radius,
        "object_max_neighbours": rule.neighbours,
        "controller_radius": grip.radius,
        "controller_max_neighbours": grip.neighbours,
    }


def _checkpoint(mechanics: Mechanics, springs: int, strength: Float64[Array, " S"]) -> bytes:
    """`best_0.pth`: stiffness per strain in the order of its rule."""
    import torch

    def one(value: float) -> torch.Tensor:
        return torch.tensor([value], dtype=torch.float32)

    content = {
        "epoch": 0,
        "num_object_springs": springs,
        "spring_Y": torch.from_numpy(strength.astype(np.float32)),
        "collide_elas": one(mechanics.restitution),
        "collide_fric": one(mechanics.friction),
        "collide_object_elas": one(mechanics.restitution),
        "collide_object_fric": one(mechanics.friction),
    }
    stream = io.BytesIO()
    torch.save(content, stream)
    return stream.getvalue()


def _splats(twin: "TwinBundle", mechanics: Mechanics) -> Gaussians:
    """The Gaussians at rest in its frame, with the harmonics of degree 3 that it asks for."""
    given = twin.gaussians
    harmonics = np.zeros((len(given), 3, HARMONICS // 3), np.float32)
    if given.harmonics is not None:
        each = given.harmonics.shape[1] // 3
        harmonics[:, :, :each] = given.harmonics.reshape(len(given), 3, each) * TURNED[:each]
    broad = np.sqrt(np.sort(given.scales, axis=1)[:, 1:].prod(axis=1, keepdims=True))
    w, x, y, z = given.quaternions.T  # half a turn about x is the quaternion (0, 1, 0, 0)
    return Gaussians(
        means=_down(given.means, mechanics).astype(np.float32),
        scales=np.where(_flat(given)[:, None], broad, given.scales).astype(np.float32),
        quaternions=np.stack([-x, w, -z, y], axis=1),
        opacities=given.opacities,
        colors=given.colors,
        volumes=given.volumes,
        harmonics=harmonics.reshape(len(given), HARMONICS),
    )


def _pickle(content: object) -> bytes:
    return pickle.dumps(content, protocol=4)


def _readme(twin: "TwinBundle", mechanics: Mechanics, losses: tuple[str, ...]) -> str:
    limits = [
        "Its simulator steps at 5e-5 s, 667 steps per frame at 30 frames per second, whatever the twin "
        "needs.",
        f"Gravity is {GRAVITY} m/s² there. Controllers count as still in its dampers.",
    ]
    if mechanics.ground_height is None:
        limits.append(f"The ground z = 0 is always there: the twin floats {ALOFT:g} m above it.")
    return write_readme(
        twin,
        "A MatPhys twin for PhysTwin's playground",
        files=[
            (f"data/different_types/{CASE}", "points, control points and camera"),
            (f"experiments_optimization/{CASE}", "global parameters and the rule of the springs"),
            (f"experiments/{CASE}", "stiffness per strain of each spring, in the order of that rule"),
            (f"gaussian_output/{CASE}", "the Gaussians"),
        ],
        frame="World frame: right-handed, z down, the ground at 0; metres, seconds. Mass 1 at every point: "
        "stiffness per strain in N/kg, dashpot in N·s/m per kg.",
        use=[
            "Copy the folders over a checkout of Jianghanxiao/PhysTwin, then "
            f"`python interactive_playground.py --case_name {CASE} --n_ctrl_parts 1`.",
            "The .pkl and .pth files are pickles, as that program reads them.",
        ],
        limits=[*limits, *losses],
    )
