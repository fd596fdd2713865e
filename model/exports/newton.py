"""A twin for Newton: its arrays, and a short script that builds and runs it."""

from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from model.exports.base import Exporter
from model.exports.folder import npz_bytes, write_folder
from model.exports.mechanics import Mechanics, mechanics_of
from model.exports.readme import FRAME, write_readme

if TYPE_CHECKING:
    from model.bundle import TwinBundle

SCRIPT = Path(__file__).parent / "scripts" / "newton_run.py"


class NewtonExporter(Exporter):
    """A folder with `twin.npz` and `run.py`, which makes a `newton.Model` and steps it.

    Springs and dampers are Newton's own, in its semi-implicit solver; controllers are particles that it does
    not move. What its particles lack, drag and the impact of the ground, is a kernel of the script.

    Reference:
        Newton developers (2025), Newton: an open-source physics engine on NVIDIA Warp, newton-physics.
    """

    name: ClassVar[str] = "newton"

    def __call__(self, twin: "TwinBundle", out: Path) -> list[Path]:
        """Write the folder `out`."""
        mechanics = mechanics_of(twin)
        files = {
            "twin.npz": npz_bytes(_arrays(mechanics)),
            "run.py": SCRIPT.read_bytes(),
            "README.md": _readme(twin, mechanics, self.losses(twin)).encode(),
        }
        return write_folder(out, files)


def _arrays(mechanics: Mechanics) -> dict[str, np.ndarray]:
    ground = mechanics.ground_height
    return {
        "points": mechanics.points.astype(np.float32),
        "mass": mechanics.mass.astype(np.float32),
        "edges": mechanics.edges.astype(np.int32),
        "rest_length": mechanics.rest_length.astype(np.float32),
        "stiffness": mechanics.stiffness.astype(np.float32),
        "times": mechanics.times,
        "controls": mechanics.controls.astype(np.float32),
        "gravity": np.array(mechanics.gravity),
        "dashpot_damping": np.array(mechanics.dashpot_damping),
        "drag_rate": np.array(mechanics.drag_rate),
        "friction": np.array(mechanics.friction),
        "restitution": np.array(mechanics.restitution),
        "ground_height": np.array(np.nan if ground is None else ground),
        "substeps": np.array(mechanics.substeps),
    }


def _readme(twin: "TwinBundle", mechanics: Mechanics, losses: tuple[str, ...]) -> str:
    limits = [
        "Newton computes in single precision: positions differ from the twin's in the last digits.",
        "Newton's particles have no drag and no impact with the ground: the kernel `finish` of run.py has to "
        "follow each step, in a scene of your own too.",
    ]
    limits.append("The Gaussians are not in it: export them with `--to ply` or `--to usd`.")
    arrays = (
        "points [N, 3] m, mass [N] kg, edges [E, 2] (points from 0, then controllers from N), rest_length [E]"
    )
    arrays += (
        " m, stiffness [E] N/m, times [T] s, controls [T, C, 3] m, gravity [3] m/s², dashpot_damping N·s/m,"
    )
    arrays += " drag_rate 1/s, friction, restitution, ground_height m (NaN: no ground), substeps per frame"
    return write_readme(
        twin,
        "A MatPhys twin in Newton",
        files=[
            ("twin.npz", arrays),
            ("run.py", "builds a newton.ModelBuilder from it and runs it; needs newton, warp-lang and numpy"),
        ],
        frame=FRAME,
        use=[
            "`python run.py --out trajectory.npz` runs the recorded motion. `build(twin)` gives the model, "
            f"`SolverSemiImplicit` steps it by at most {mechanics.step:.6g} s."
        ],
        limits=[*limits, *losses],
    )
