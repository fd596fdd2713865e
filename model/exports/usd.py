"""A twin as an OpenUSD stage: Gaussians, points, springs and parameters, moving."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from model.errors import InputError
from model.exports.base import Exporter
from model.exports.mechanics import Mechanics, mechanics_of, point_colors, point_radius, roll
from model.exports.moving import EVERY_EFFECT, moving_gaussians
from model.exports.readme import FRAME, write_readme
from model.formats.files import replacing
from model.formats.ply import HARMONIC_0
from model.types import Array, Gaussians, Trajectory

if TYPE_CHECKING:
    from model.bundle import TwinBundle

SUFFIXES = (".usdc", ".usda", ".usd")
PARAMETERS = {
    "dashpot_damping": "Damping along every spring [N*s/m].",
    "drag_rate": "Velocities shrink by exp(-drag_rate * t) [1/s].",
    "friction": "Coulomb's coefficient with the ground and with itself.",
    "restitution": "Share of the normal speed that an impact leaves.",
    "collision_distance": "Points closer than this meet [m]; 0: they pass.",
    "bending_decay": "Rate at which zigzags between neighbouring points die out [1/s].",
}


class UsdExporter(Exporter):
    """One stage with the Gaussians as `ParticleField3DGaussianSplat`, and everything else as primvars.

    Time samples are the twin's own rollout under the recorded motion.

    Reference:
        Alliance for OpenUSD (2026), UsdVol: ParticleField3DGaussianSplat; UsdGeom: Points, BasisCurves.
    """

    name: ClassVar[str] = "usd"
    expressed: ClassVar[frozenset[str]] = EVERY_EFFECT
    simulated: ClassVar[bool] = False

    def __call__(self, twin: "TwinBundle", out: Path) -> list[Path]:
        """Write the file `out`, named .usdc, .usda or .usd."""
        if out.suffix not in SUFFIXES:
            raise InputError(f"{out}: give a name that ends in {', '.join(SUFFIXES)}")
        usd = _package()
        trajectory = roll(twin)
        stage = usd.Usd.Stage.CreateInMemory()
        _Stage(usd, stage, trajectory).write(twin, mechanics_of(twin))
        with replacing(out) as temporary:
            if not stage.GetRootLayer().Export(str(temporary)):
                raise InputError(f"cannot write {out}")
        return [out]


def _package() -> Any:  # noqa: ANN401 - a package without types
    try:
        import pxr.Sdf
        import pxr.Usd
        import pxr.UsdGeom
        import pxr.UsdVol
        import pxr.Vt
    except ImportError:
        raise InputError("usd: the package usd-core is missing: pip install 'matphys[usd]'") from None
    return pxr


class _Stage:
    """What is written where."""

    def __init__(self, pxr: Any, stage: Any, trajectory: Trajectory) -> None:  # noqa: ANN401
        self.pxr, self.stage, self.trajectory = pxr, stage, trajectory

    def write(self, twin: "TwinBundle", mechanics: Mechanics) -> None:
        geom, fps = self.pxr.UsdGeom, 1.0 / mechanics.interval
        geom.SetStageUpAxis(self.stage, geom.Tokens.z)
        geom.SetStageMetersPerUnit(self.stage, 1.0)
        self.stage.SetTimeCodesPerSecond(fps)
        self.stage.SetFramesPerSecond(fps)
        self.stage.SetStartTimeCode(0)
        self.stage.SetEndTimeCode(len(self.trajectory.times) - 1)
        root = geom.Xform.Define(self.stage, "/Twin")
        self.stage.SetDefaultPrim(root.GetPrim())
        self.pxr.Usd.ModelAPI(root.GetPrim()).SetKind("component")
        readme = _readme(twin)
        root.GetPrim().SetDocumentation(readme)
        self.stage.GetRootLayer().documentation = readme
        self._parameters(root, mechanics)
        self._gaussians(twin)
        self._points(twin, mechanics)
        self._springs("Springs", mechanics, slice(0, mechanics.spring_count))
        if len(mechanics.controllers):
            self._controllers(mechanics)
            self._springs("ControllerSprings", mechanics, slice(mechanics.spring_count, None))

    def _parameters(self, root: Any, mechanics: Mechanics) -> None:  # noqa: ANN401
        types = self.pxr.Sdf.ValueTypeNames
        values = {name: float(getattr(mechanics, name)) for name in PARAMETERS}
        texts = dict(PARAMETERS)
        if mechanics.ground_height is not None:
            values["ground_height"], texts["ground_height"] = mechanics.ground_height, "z of the ground [m]."
        for name, value in values.items():
            self._primvar(root, name, types.Float, "constant", value, texts[name])
        self._primvar(root, "gravity", types.Vector3f, "constant", mechanics.gravity, "Gravity [m/s^2].")

    def _gaussians(self, twin: "TwinBundle") -> None:
        gaussians, vt = twin.gaussians, self.pxr.Vt
        field = self.pxr.UsdVol.ParticleField3DGaussianSplat.Define(self.stage, "/Twin/Gaussians")
        field.GetPrim().SetDocumentation(
            "The Gaussians: centres [m], standard deviations along their axes [m]."
        )
        field.CreateScalesAttr(vt.Vec3fArray.FromNumpy(gaussians.scales))
        field.CreateOpacitiesAttr(vt.FloatArray.FromNumpy(gaussians.opacities))
        coefficients, degree = _harmonics(gaussians)
        field.CreateRadianceSphericalHarmonicsDegreeAttr(degree)
        field.CreateRadianceSphericalHarmonicsCoefficientsAttr(vt.Vec3fArray.FromNumpy(coefficients))
        places, turns = field.CreatePositionsAttr(), field.CreateOrientationsAttr()
        extent, reach = field.CreateExtentAttr(), 3.0 * float(gaussians.scales.max())
        for time, moved in enumerate(moving_gaussians(twin, self.trajectory)):
            places.Set(vt.Vec3fArray.FromNumpy(moved.means), time)
            # Quaternions are stored imaginary part first.
            turns.Set(vt.QuatfArray.FromNumpy(np.ascontiguousarray(moved.quaternions[:, [1, 2, 3, 0]])), time)
            extent.Set(self._extent(moved.means, reach), time)

    def _points(self, twin: "TwinBundle", mechanics: Mechanics) -> None:
        types, vt = self.pxr.Sdf.ValueTypeNames, self.pxr.Vt
        points = self.pxr.UsdGeom.Points.Define(self.stage, "/Twin/Points")
        points.GetPrim().SetDocumentation("The mass points of the twin [m].")
        radius = point_radius(mechanics.points)
        points.CreateWidthsAttr(vt.FloatArray([2.0 * radius]))
        points.SetWidthsInterpolation("constant")
        points.CreatePurposeAttr("guide")
        colors = points.CreateDisplayColorPrimvar("vertex")
        colors.Set(vt.Vec3fArray.FromNumpy(point_colors(twin).astype(np.float32)))
        mass = vt.FloatArray.FromNumpy(mechanics.mass.astype(np.float32))
        self._primvar(points, "mass", types.FloatArray, "vertex", mass, "Mass of each point [kg].")
        part = vt.IntArray.FromNumpy(twin.topology.part)
        self._primvar(points, "part", types.IntArray, "vertex", part, "Part that each point belongs to.")
        self._move(points, self.trajectory.points, radius)

    def _controllers(self, mechanics: Mechanics) -> None:
        hands = self.pxr.UsdGeom.Points.Define(self.stage, "/Twin/Controllers")
        hands.GetPrim().SetDocumentation("Where the hand holds the object, moving as recorded [m].")
        hands.CreateWidthsAttr(self.pxr.Vt.FloatArray([0.01]))
        hands.SetWidthsInterpolation("constant")
        hands.CreatePurposeAttr("guide")
        self._move(hands, mechanics.controls.astype(np.float32), 0.005)

    def _springs(self, name: str, mechanics: Mechanics, which: slice) -> None:
        """Straight curves between the ends of each spring; nothing where there is none."""
        types, vt, edges = self.pxr.Sdf.ValueTypeNames, self.pxr.Vt, mechanics.edges[which]
        if not len(edges):
            return
        curves = self.pxr.UsdGeom.BasisCurves.Define(self.stage, f"/Twin/{name}")
        curves.GetPrim().SetDocumentation("A straight line per spring, from its first end to its second.")
        curves.CreateTypeAttr("linear")
        curves.CreateWrapAttr("nonperiodic")
        curves.CreateCurveVertexCountsAttr(vt.IntArray.FromNumpy(np.full(len(edges), 2, np.int32)))
        curves.CreateWidthsAttr(vt.FloatArray([0.0005]))
        curves.SetWidthsInterpolation("constant")
        curves.CreatePurposeAttr("guide")
        ends = vt.Vec2iArray.FromNumpy(np.ascontiguousarray(edges, np.int32))
        text = f"Ends: points from 0, then controllers from {len(mechanics.points)}."
        self._primvar(curves, "ends", types.Int2Array, "uniform", ends, text)
        for key, values, text in (
            ("stiffness", mechanics.stiffness, "Stiffness of each spring [N/m]."),
            ("restLength", mechanics.rest_length, "Rest length of each spring [m]."),
        ):
            numbers = vt.FloatArray.FromNumpy(values[which].astype(np.float32))
            self._primvar(curves, key, types.FloatArray, "uniform", numbers, text)
        controls = mechanics.controls.astype(np.float32)
        nodes = np.concatenate([self.trajectory.points, controls], axis=1)
        self._move(curves, nodes[:, edges.ravel()], 0.0005)

    def _primvar(self, prim: Any, name: str, kind: Any, interpolation: str, value: Any, text: str) -> None:  # noqa: ANN401
        primvar = self.pxr.UsdGeom.PrimvarsAPI(prim).CreatePrimvar(name, kind, interpolation)
        primvar.Set(value)
        primvar.GetAttr().SetDocumentation(text)

    def _move(self, prim: Any, places: Array, reach: float) -> None:  # noqa: ANN401
        points, extent = prim.CreatePointsAttr(), prim.CreateExtentAttr()
        for time, frame in enumerate(places):
            points.Set(self.pxr.Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(frame)), time)
            extent.Set(self._extent(frame, reach), time)

    def _extent(self, places: Array, reach: float) -> Any:  # noqa: ANN401
        corners = np.stack([places.min(axis=0) - reach, places.max(axis=0) + reach]).astype(np.float32)
        return self.pxr.Vt.Vec3fArray.FromNumpy(corners)


def _harmonics(gaussians: Gaussians) -> tuple[Array, int]:
    """Coefficients of each Gaussian in a row [G (d+1)², 3], and the degree d; as 3DGS has them: 0.5 + sum."""
    base = ((gaussians.colors - 0.5) / HARMONIC_0).astype(np.float32)[:, None]
    if gaussians.harmonics is None or not gaussians.harmonics.shape[1]:
        return base[:, 0], 0
    higher = gaussians.harmonics.reshape(len(gaussians), 3, -1).transpose(0, 2, 1)
    degree = int(np.sqrt(higher.shape[1] + 1)) - 1
    kept = np.concatenate([base, higher[:, : (degree + 1) ** 2 - 1]], axis=1)
    return np.ascontiguousarray(kept.reshape(-1, 3), np.float32), degree


def _readme(twin: "TwinBundle") -> str:
    return write_readme(
        twin,
        "A MatPhys twin in OpenUSD",
        files=[
            ("/Twin", "primvars: the parameters of the twin"),
            ("/Twin/Gaussians", "ParticleField3DGaussianSplat, moving; colour 0.5 + sum of harmonics"),
            ("/Twin/Points", "the mass points, moving; primvars mass, part (purpose guide)"),
            ("/Twin/Springs", "a line per spring; primvars ends, stiffness, restLength (purpose guide)"),
            (
                "/Twin/Controllers, /Twin/ControllerSprings",
                "the hand as recorded, and the springs it holds by",
            ),
        ],
        frame=f"{FRAME} A time code is a frame of the clip.",
        limits=[
            "USD has no mass-spring law: the motion is the twin's own rollout, and the primvars are for "
            "readers who simulate.",
            "Harmonics above the first do not turn with the Gaussians.",
        ],
    )
