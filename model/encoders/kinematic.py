"""Motion described by comparison: where between twins of known stuff does what was seen lie?"""

from itertools import pairwise
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64

from model.encoders.frame_rate import at_frame_rate
from model.encoders.motion import GLOBALS, EncodedMotion, MotionClip, MotionEncoder, ReferenceMotion
from model.encoders.response import BEFORE, Answer, explain, spreads_before
from model.encoders.seen import Look, across, looks, surroundings
from model.errors import InputError
from model.types import Array

LOOKS = ("place", "speed", "shape")
SCALES = 5
"""Twins of one modulus in the sweep."""
WINDOWS = 3
MIDDLE, WIDTH = float(np.log(100.0)), 1.5
"""ln E/ρ [m²/s²] that is 0 in the features, and what is 1."""
USUAL = np.array([-3.0, -0.5, -0.7, -1.1])
"""Of `GLOBALS`, as the base has them: 0 in the features."""
NOISE = 1e-3
"""Errors of a place [m] that mean nothing."""
MOST = 4.0
"""No feature is larger."""


class KinematicEncoder(MotionEncoder):
    """What the motion says about stiffness and damping, in plain numbers; there are no weights.

    Seen points are compared with simulated twins of the same body (`ReferenceMotion`) in three looks:
    place, speed and shape (`model.encoders.seen`). Per point: error against each twin of the sweep, by
    place and shape, as logarithms above the least; the modulus between twins that fits place and shape around
    the point best, with how far the twins differ there; how the point moved. Per part (`PART_FEATURES`):
    change of its modulus that explains the residual of the base twin best, jointly with that of all other
    constants, with its spread, per look; the modulus that fits it best in the sweep. Per clip: the same for
    dashpot, drag, friction and restitution; errors against the sweep by time; how the object moved.

    Clips of another frame rate are described as if filmed `FRAME_RATE` times a second.

    All moduli are ln E/ρ [m²/s²] over `WIDTH` around `MIDDLE`: a prior's modulus over its density compares.
    """

    name: ClassVar[str] = "kinematic"
    version: ClassVar[str] = "3"
    needs_references: ClassVar[bool] = True
    PART_FEATURES: ClassVar[int] = 3 * len(LOOKS) + 3

    def __init__(self) -> None:
        """Needs nothing: there are no weights."""
        super().__init__()
        self.dim = 2 * SCALES + 9 + self.PART_FEATURES
        self.global_dim = SCALES * (WINDOWS + 1) + 1 + 3 * len(GLOBALS) * len(LOOKS) + len(LOOKS) + 7

    def forward(self, clip: MotionClip) -> EncodedMotion:
        """Describe a clip.

        Raises:
            InputError: the clip has no twins of reference.
        """
        if clip.references is None:
            raise InputError(f"{self.name} motion encoder: the clip comes without twins of reference")
        clip, references = at_frame_rate(clip, clip.references)
        seen = _Seen(clip, references)
        answers = {name: seen.explained(name) for name in LOOKS}
        points = np.concatenate([seen.profiles(), seen.local(), seen.moved()], axis=1)
        parts = np.stack([self._part(seen, answers, k) for k in range(clip.parts)])
        return EncodedMotion(_tame(points), _tame(parts), _tame(self._whole(seen, answers)))

    def _part(self, seen: "_Seen", answers: dict[str, Answer], part: int) -> Float64[Array, " Dk"]:
        base = seen.references.base_log_modulus[part]
        values = []
        for answer in answers.values():
            change, spread = answer.change[part], answer.spread[part]
            values += [(base + change - MIDDLE) / WIDTH, change, _sureness(spread, BEFORE[0])]
        here = seen.clip.part == part
        values += [seen.fitting(name, here.astype(np.float64)[None])[0][0] for name in ("place", "shape")]
        values.append(float(seen.known[:, here].mean()) if here.any() else 0.0)
        return np.array(values)

    def _whole(self, seen: "_Seen", answers: dict[str, Answer]) -> Float64[Array, " Dg"]:
        references = seen.references
        values = [*seen.profile_by_time(), (references.base_log_modulus.mean() - MIDDLE) / WIDTH]
        for answer in answers.values():
            for number in range(len(GLOBALS)):
                change, spread = (v[seen.clip.parts + number] for v in (answer.change, answer.spread))
                known = references.base_globals[number] + change - USUAL[number]
                values += [known / 2.0, change, _sureness(spread, BEFORE[1 + number])]
        values += [np.log(answer.error / NOISE) for answer in answers.values()]
        return np.array([*values, *seen.moved_whole()])


class _Seen:
    """A clip beside its references, prepared for all that is asked of it."""

    def __init__(self, clip: MotionClip, references: ReferenceMotion) -> None:
        frames = len(references.base)
        self.clip, self.references = clip, references
        points = clip.points[:frames]
        self.known: Bool[Array, "T N"] = np.isfinite(points).all(axis=-1)
        self.looks = looks(clip.rest, self.known)
        self.around = surroundings(clip.rest) + np.eye(len(clip.rest))
        self.sweep = self._off(points - references.sweep, points)
        self.base = self._off(points - references.base, points)
        self.displaced = self._off(points - clip.rest, points)
        steps = np.where(references.steps == 0.0, 1.0, references.steps)[:, None, None, None]
        self.response = self._off((references.varied - references.base) / steps, points)
        self.size = float(np.sqrt(((clip.rest - clip.rest.mean(axis=0)) ** 2).sum(axis=1).mean())) + 1e-9
        frame = float(np.diff(clip.times[:frames]).mean())
        self.fall = np.sqrt(max(float(np.linalg.norm(clip.gravity)), 1e-3) * self.size)
        self.frame = frame

    def _off(
        self, differences: Float[Array, "*v T N 3"], points: Float32[Array, "T N 3"]
    ) -> Float64[Array, "*v T N 3"]:
        values = across(
            differences, np.where(self.known[..., None], points, self.clip.rest), self.clip.camera
        )
        return np.asarray(np.where(self.known[..., None], values, 0.0), np.float64)

    def look(self, name: str) -> tuple[Look, Bool[Array, "U N"]]:
        return self.looks[name]

    def explained(self, name: str) -> Answer:
        """Changes of all constants that explain the base's residual in one look."""
        look, known = self.look(name)
        return explain(look(self.base), look(self.response), known, spreads_before(self.clip.parts))

    def profiles(self) -> Float64[Array, "N m"]:
        """Log errors against the sweep around each point, above the least."""
        return np.concatenate([self._profile(name, self.around) for name in ("place", "shape")], axis=1)

    def local(self) -> Float64[Array, "N 4"]:
        """Modulus that fits around each point, and how sharply, by place and by shape."""
        found = [self.fitting(name, self.around) for name in ("place", "shape")]
        return np.stack([column for pair in found for column in pair], axis=1)

    def moved(self) -> Float64[Array, "N 5"]:
        """How far, fast and jerkily each point moved, how its shape changed; how often it was seen."""
        far, fast, bent = (self._usual(name, self.displaced) for name in ("place", "speed", "shape"))
        jerk = self._jerk()
        columns = [_log_over(v, self.size) for v in (far, fast, bent, jerk)]
        return np.stack([*columns, self.known.mean(axis=0)], axis=1)

    def moved_whole(self) -> Float64[Array, " 7"]:
        """How the object moved as a whole; its size; what was held."""
        far, fast, bent = (
            np.sqrt((self._usual(name, self.displaced) ** 2).mean()) for name in ("place", "speed", "shape")
        )
        jerk = np.sqrt((self._jerk() ** 2).mean())
        columns = [_log_over(np.array(v), self.size) for v in (far, fast, bent, jerk)]
        pace = np.log(self.fall * self.frame / self.size)
        held = 1.0 if self.clip.controllers.shape[1] else 0.0
        return np.array([*columns, np.log(self.size / 0.1), pace + 1.0, held])

    def profile_by_time(self) -> Float64[Array, " m"]:
        """Log errors against the sweep, in each third of the time and by shape in all of it."""
        everywhere = np.ones((1, len(self.clip.rest)))
        edges = np.linspace(0, len(self.known), WINDOWS + 1).astype(int)
        windows = [self._profile("place", everywhere, slice(begin, end))[0] for begin, end in pairwise(edges)]
        return np.concatenate([*windows, self._profile("shape", everywhere)[0]])

    def fitting(
        self, name: str, pool: Float64[Array, "m N"]
    ) -> tuple[Float64[Array, " m"], Float64[Array, " m"]]:
        """Modulus at which the way from one twin of the sweep to the next comes nearest to what was seen.

        Args:
            name: Of the look.
            pool: Which points count in each row.

        Returns:
            Moduli as features, and the logarithm of how much twins differ there over the noise.
        """
        look, known = self.look(name)
        off = look(self.sweep)
        way = off[:-1] - off[1:]
        count = np.maximum(known.sum(axis=0) @ pool.T, 1.0)
        length = np.einsum("rtni,rtni,mn->rm", way, way, pool, optimize=True)
        along = np.einsum("rtni,rtni,mn->rm", off[:-1], way, pool, optimize=True)
        left = np.einsum("rtni,rtni,mn->rm", off[:-1], off[:-1], pool, optimize=True)
        share = np.clip(along / (length + count * NOISE**2), 0.0, 1.0)
        error = left - 2.0 * share * along + share**2 * length
        best = error.argmin(axis=0)
        column = np.arange(len(pool))
        logs = self.references.sweep_log_modulus
        modulus = logs[best] + share[best, column] * (logs[best + 1] - logs[best])
        sharp = 0.5 * np.log(length.mean(axis=0) / (count * NOISE**2) + 1e-2)
        return (modulus - MIDDLE) / WIDTH, sharp / 2.0

    def _profile(
        self, name: str, pool: Float64[Array, "m N"], window: slice = slice(None)
    ) -> Float64[Array, "m R"]:
        look, known = self.look(name)
        square = (look(self.sweep)[:, window] ** 2).sum(axis=-1).sum(axis=1) @ pool.T
        count = np.maximum(known[window].sum(axis=0) @ pool.T, 1.0)
        level = 0.5 * np.log(square / count + NOISE**2)
        return np.asarray((level - level.min(axis=0)).T, np.float64)

    def _usual(self, name: str, values: Float64[Array, "T N 3"]) -> Float64[Array, " N"]:
        look, known = self.look(name)
        square = (look(values) ** 2).sum(axis=-1).sum(axis=0)
        return np.asarray(np.sqrt(square / np.maximum(known.sum(axis=0), 1)), np.float64)

    def _jerk(self) -> Float64[Array, " N"]:
        """Usual size of the third difference of a point's place [m]."""
        known = self.known[3:] & self.known[2:-1] & self.known[1:-2] & self.known[:-3]
        change = np.where(known[..., None], np.diff(self.displaced, n=3, axis=0), 0.0)
        square = (change**2).sum(axis=-1).sum(axis=0)
        return np.asarray(np.sqrt(square / np.maximum(known.sum(axis=0), 1)), np.float64)


def _sureness(spread: float, before: float) -> float:
    """0 where nothing was learned, then 1 for each factor of e."""
    return float(np.log(before / spread))


def _log_over(values: Float64[Array, "*n"], unit: float) -> Float64[Array, "*n"]:
    """Logarithm of a length over a unit, of order 1, flat below a thousandth."""
    return np.asarray(0.5 * np.log(values / unit + 1e-3) + 1.5, np.float64)


def _tame(values: Float64[Array, "*n"]) -> Float32[Array, "*n"]:
    """Within ±`MOST`."""
    tamed: Float32[Array, "*n"] = np.clip(values, -MOST, MOST).astype(np.float32)
    return tamed
