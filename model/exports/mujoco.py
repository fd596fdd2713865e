"""A twin for MuJoCo: one MJCF that loads as it is, and a script that replays the recorded motion."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from jaxtyping import Float64

from model.exports.base import Exporter
from model.exports.folder import npz_bytes, write_folder
from model.exports.mechanics import Mechanics, mechanics_of, point_colors, point_radius
from model.exports.readme import FRAME, write_readme
from model.exports.soft_contact import soft_contact
from model.types import Array

if TYPE_CHECKING:
    from model.bundle import TwinBundle

SCRIPT = Path(__file__).parent / "scripts" / "mujoco_replay.py"
RADIUS = 1e-3
"""Of the balls that touch the ground [m]; the plane lies as much lower."""
HARD = "0.001 0.001 0.001"
"""Impedance at which a contact is a spring and a damper; a harder one lets slip lift things."""
STUCK = 500.0
"""Drag times a time step, beyond which nothing moves and exponentials leave the numbers."""


class MujocoExporter(Exporter):
    r"""A folder with `twin.xml`, what to replay, and a script that does.

    - point: a body on three slide joints, with a site; drag of rate δ as joint damping
      $m\,(e^{\delta\,dt}-1)/dt$, which MuJoCo's Euler step takes implicitly, so that velocities shrink by
      exactly $e^{-\delta\,dt}$;
    - spring: a tendon between two sites with its own stiffness, damping and length;
    - controller: a mocap body;
    - ground: a plane and a ball per point, whose contact is a spring and a damper that give the restitution.

    Reference:
        Todorov, Erez and Tassa (2012), MuJoCo: A physics engine for model-based control, IROS.
    """

    name: ClassVar[str] = "mujoco"

    def __call__(self, twin: "TwinBundle", out: Path) -> list[Path]:
        """Write the folder `out`."""
        mechanics = mechanics_of(twin)
        ground = mechanics.ground_height
        grips = mechanics.edges[mechanics.spring_count :]
        replay = {
            "times": mechanics.times,
            "controls": mechanics.controls,
            "rest": mechanics.points,
            "grips": np.stack([grips[:, 1] - len(mechanics.points), grips[:, 0]], axis=1),
            "dashpot_damping": np.array(mechanics.dashpot_damping),
            "substeps": np.array(mechanics.substeps),
            "ground_height": np.array(np.nan if ground is None else ground),
            "friction": np.array(mechanics.friction),
            "restitution": np.array(mechanics.restitution),
        }
        document = write_document(mechanics, point_colors(twin), twin.manifest.id)
        files = {
            "twin.xml": document.encode(),
            "replay.npz": npz_bytes(replay),
            "replay.py": SCRIPT.read_bytes(),
            "README.md": _readme(twin, mechanics, self.losses(twin)).encode(),
        }
        return write_folder(out, files)


def write_document(mechanics: Mechanics, colors: Float64[Array, "N 3"], name: str) -> str:
    """The MJCF.

    Args:
        mechanics: What moves.
        colors: Of the points, 0..1.
        name: Of the model.
    """
    step = mechanics.step
    lines = [
        f'<mujoco model="{_word(name)}">',
        f'<option timestep="{step!r}" integrator="Euler" gravity="{_row(mechanics.gravity)}" cone="elliptic"'
        ' impratio="1e7" jacobian="sparse" tolerance="1e-14"/>',
        '<size memory="512M"/>',
        "<default>",
        '<joint type="slide"/><tendon group="4" width="0.0005" rgba=".6 .6 .6 .4"/>',
        f'<default class="skin"><geom size="{point_radius(mechanics.points)!r}" mass="0" contype="0"'
        ' conaffinity="0" group="1"/></default>',
        f'<default class="touch"><geom size="{RADIUS}" mass="0" contype="0" conaffinity="0"'
        ' group="3"/></default>',
        '<default class="hand"><geom size="0.006" mass="0" rgba=".9 .3 .2 1" contype="0" conaffinity="0"'
        ' group="2"/></default>',
        "</default>",
        "<asset>",
        '<texture name="board" type="2d" builtin="checker" rgb1=".8 .8 .8" rgb2=".7 .7 .7" width="256"'
        ' height="256"/>',
        '<material name="board" texture="board" texrepeat="10 10" texuniform="true"/>',
        "</asset>",
        "<worldbody>",
        '<light pos="0 0 3" dir="0 0 -1" castshadow="false"/>',
    ]
    if mechanics.ground_height is not None:
        lines.append(_plane(mechanics.ground_height))
    damping = mechanics.mass * math.expm1(min(mechanics.drag_rate * step, STUCK)) / step
    each = zip(
        mechanics.points.tolist(), mechanics.mass.tolist(), damping.tolist(), colors.tolist(), strict=True
    )
    lines += [_point(i, place, mass, drag, color) for i, (place, mass, drag, color) in enumerate(each)]
    lines += [_hand(i, place) for i, place in enumerate(mechanics.controls[0].tolist())]
    lines += ["</worldbody>", "<tendon>", *_tendons(mechanics), "</tendon>"]
    if mechanics.ground_height is not None:
        lines += ["<contact>", *_contacts(mechanics), "</contact>"]
    return "\n".join([*lines, "</mujoco>", ""])


def _plane(height: float) -> str:
    return (
        f'<geom name="ground" type="plane" size="0 0 1" pos="0 0 {height - RADIUS!r}" material="board"'
        ' contype="0" conaffinity="0"/>'
    )


def _point(index: int, place: list[float], mass: float, damping: float, color: list[float]) -> str:
    joints = "".join(f'<joint axis="{axis}" damping="{damping!r}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    tint = " ".join(f"{value:.3f}" for value in color)
    return (
        f'<body name="point{index}" pos="{_row(place)}">'
        f'<inertial pos="0 0 0" mass="{mass!r}" diaginertia="1 1 1"/>{joints}'
        f'<site name="p{index}"/><geom class="skin" rgba="{tint} 1"/>'
        f'<geom name="t{index}" class="touch"/></body>'
    )


def _hand(index: int, place: list[float]) -> str:
    return (
        f'<body name="controller{index}" mocap="true" pos="{_row(place)}"><site name="c{index}"/>'
        '<geom class="hand"/></body>'
    )


def _tendons(mechanics: Mechanics) -> list[str]:
    """One per spring."""
    names = [f"p{i}" for i in range(len(mechanics.points))]
    names += [f"c{i}" for i in range(len(mechanics.controllers))]
    damping = f' damping="{mechanics.dashpot_damping!r}"' if mechanics.dashpot_damping else ""
    each = zip(
        mechanics.edges.tolist(), mechanics.stiffness.tolist(), mechanics.rest_length.tolist(), strict=True
    )
    return [
        f'<spatial stiffness="{stiffness!r}"{damping} springlength="{length!r}">'
        f'<site site="{names[i]}"/><site site="{names[j]}"/></spatial>'
        for (i, j), stiffness, length in each
    ]


def _contacts(mechanics: Mechanics) -> list[str]:
    """The plane paired with every point.

    Friction works against slip by damping: the strongest that a step takes, 1/dt, leaves Coulomb's law alone.
    """
    stiffness, damping = soft_contact(mechanics.restitution, mechanics.step)
    law = f'condim="3" friction="{mechanics.friction!r} {mechanics.friction!r}" solimp="{HARD}"'
    law += f' solref="{-stiffness!r} {-damping!r}" solreffriction="-1 {-0.001 / mechanics.step!r}"'
    return [f'<pair geom1="ground" geom2="t{i}" {law}/>' for i in range(len(mechanics.points))]


def _readme(twin: "TwinBundle", mechanics: Mechanics, losses: tuple[str, ...]) -> str:
    step = f"{mechanics.step:.6g} s ({mechanics.substeps} per frame of the clip)"
    limits = [
        f"The drag in the joints' damping is exact for the time step of {step}: with another one, set it to "
        "m (exp(drag_rate dt) - 1) / dt.",
        "MuJoCo gives mocap bodies no velocity, so the dampers between controllers and points see a "
        "controller at rest; `replay.py` adds the force that is missing, the viewer alone does not.",
    ]
    if mechanics.ground_height is not None:
        limits.append(
            "MuJoCo's contact with the ground is a spring and a damper that take some steps, where the "
            "twin's is an impact: a bounce comes some steps late, and a point sinks by what it moves in a "
            "step. `replay.py` puts the twin's impact in its place, `replay.py --ground contact` does not."
        )
    return write_readme(
        twin,
        "A MatPhys twin in MuJoCo",
        files=[
            (
                "twin.xml",
                "the model: points on slide joints, a tendon per spring, controllers as mocap bodies",
            ),
            ("replay.npz", "the recorded motion of the controllers: times [T] s, controls [T, C, 3] m"),
            ("replay.py", "replays it, in the viewer or into a file; needs mujoco and numpy"),
        ],
        frame=f"{FRAME} Stiffness in N/m, damping in N·s/m. Joint positions are displacements from rest [m].",
        use=[
            "`python replay.py` shows the recorded motion, `python replay.py --out trajectory.npz` writes "
            "it. In any other program, load `twin.xml`.",
            "In the viewer, tendons are in group 4 and the balls that touch the ground in group 3, both "
            "hidden at first: a tendon per spring is more than the viewer draws.",
            f"Drag rate {mechanics.drag_rate:g} 1/s, dashpot {mechanics.dashpot_damping:g} N·s/m, friction "
            f"{mechanics.friction:g}, restitution {mechanics.restitution:g}.",
        ],
        limits=[*limits, *losses],
    )


def _row(values: "list[float] | tuple[float, ...]") -> str:
    return " ".join(repr(float(value)) for value in values)


def _word(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in name) or "twin"
