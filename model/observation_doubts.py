"""What in an observation is within the contract and yet makes any conclusion doubtful."""

import numpy as np
from jaxtyping import Bool, Float, Float64

from model.types import Array, Observation

LONG_STEP = 0.2
LONG = 600
"""Frames of which a diagnosis takes longer than ten minutes."""
ASLANT = np.pi / 4
"""Angle [rad] of gravity from downwards beyond which it is no tilted set-up, but another axis that is up."""
SHORT = 0.3
"""A recording too short [s] to tell forces from noise."""
FAST = 50.0
"""Speed [m/s] that no handled object has."""
REACH = 0.15
"""How far [m] from a point a controller may be and still be thought to hold it."""
RARELY_SEEN = 3
"""Frames: a point seen in fewer has no acceleration."""
AIRBORNE = 0.25
"""Share of its size by which the lowest point seen must be off the ground for an object to be in the air."""
FLIGHT = 0.25
"""Seconds in the air from which it can be told whether something falls."""
DRAG, HANGING = 6.0, 0.8
"""Air slows what falls, at less than so much [1/s] where it is diagnosed; what gets lower by less than such a
share of that hangs."""
LOWERED = 3.0
"""What gets lower by so many of its sizes does not hang."""
LARGE = 3.0
"""Size [m] beyond which hands do not handle an object: a small one, in centimetres?"""
WEAK = 1.5
"""Gravity [m/s²] below which next to nothing pulls an object down."""
UNIT = 1e-3
"""Gravity that is 1 m/s² within this is a direction."""
HAND_FAST = 10.0
"""Speed [m/s] that no hand has which handles an object."""
MOVING, AT_FIRST = 0.25, 0.25
"""Speed [m/s] from which an object does not begin at rest, and the seconds by which it is told."""
PARABOLA = 5
"""Frames, at least, by which a speed and how it changes are told."""


def object_size(points: Float[Array, "T N 3"]) -> float | None:
    """The longest side of the box around what is seen of the object [m], median over frames.

    None: fewer than two points are ever seen at once, so that nothing can be measured.
    """
    seen = ~np.isnan(points[..., 0])
    frames = points[seen.sum(axis=1) > 1]
    if not len(frames):
        return None
    sides = np.nanmax(frames, axis=1) - np.nanmin(frames, axis=1)
    return float(np.median(sides.max(axis=1)))


def observation_doubts(observation: Observation) -> tuple[str, ...]:
    """What the contract allows and yet makes conclusions doubtful, a line each."""
    seen = ~np.isnan(observation.points[..., 0])
    doubts = [
        *_time_doubts(observation.times),
        *_seen_doubts(seen),
        *_speed_doubts(observation, seen),
        *_start_doubts(observation),
        *_hand_doubts(observation),
        *_size_doubts(observation),
        *_grip_doubts(observation),
        *_gravity_doubts(observation),
    ]
    if hangs(observation):
        doubts.append(
            "controllers: the object stays in the air and nothing holds it: the hand is missing, so no cause "
            "can be named"
        )
    return tuple(doubts)


def _time_doubts(times: Float64[Array, " T"]) -> list[str]:
    doubts = []
    median, span = float(np.median(np.diff(times))), float(times[-1] - times[0])
    if median > LONG_STEP:
        doubts.append(f"times: {median:.3g} s between frames is too long to see what moves a soft object")
    if span < SHORT:
        doubts.append(f"times: {span:.3g} s are too short to tell forces from noise")
    if len(times) > LONG:
        doubts.append(
            f"times: {len(times)} frames take long to diagnose: a few seconds of motion tell as much"
        )
    return doubts


def _seen_doubts(seen: Bool[Array, "T N"]) -> list[str]:
    doubts = []
    rarely = int((seen.sum(axis=0) < RARELY_SEEN).sum())
    if rarely:
        doubts.append(
            f"points: {rarely} of {seen.shape[1]} points are seen in fewer than {RARELY_SEEN} frames"
        )
    blind = int((~seen.any(axis=1)).sum())
    if blind:
        doubts.append(f"points: nothing is seen in {blind} of {seen.shape[0]} frames")
    return doubts


def _speed_doubts(observation: Observation, seen: Bool[Array, "T N"]) -> list[str]:
    both = seen[1:] & seen[:-1]
    if not both.any():
        return ["points: no point is seen in two frames in a row"]
    steps = np.linalg.norm(np.diff(observation.points, axis=0), axis=2)[both]
    speed = float((steps / np.diff(observation.times)[np.nonzero(both)[0]]).max())
    return [f"points: a point moves at {speed:.3g} m/s: a lost track?"] if speed > FAST else []


def _start_doubts(observation: Observation) -> list[str]:
    speed = first_speed(observation)
    if speed <= MOVING:
        return []
    return [
        f"points: the object moves at {speed:.2g} m/s in the first frame, where a twin is at rest: begin the "
        "recording before it moves"
    ]


def first_speed(observation: Observation) -> float:
    """How fast the object is in the first frame [m/s]; 0 where that cannot be told from rest.

    The lesser of what a parabola through the first places says and what the first step does: who starts at
    once is still in the first frame, and noise alone is fast from one frame to the next.
    """
    times = observation.times - observation.times[0]
    frames = int((times <= AT_FIRST).sum())
    if frames < PARABOLA:
        return 0.0
    first = observation.points[:frames].astype(np.float64)
    tracks = first[:, np.isfinite(first[..., 0]).all(0)]
    count = tracks.shape[1]
    if not count:
        return 0.0
    powers = np.vander(times[:frames], 3, increasing=True)
    inverse = np.linalg.pinv(powers)
    noise = (tracks.reshape(frames, -1) - powers @ inverse @ tracks.reshape(frames, -1)).std()
    velocity = np.median(np.tensordot(inverse[1], tracks, axes=1), axis=0)
    unsure = 4.0 * noise * float(np.linalg.norm(inverse[1])) / np.sqrt(count)
    step = np.median(tracks[1] - tracks[0], axis=0) / times[1]
    slower = min(float(np.linalg.norm(velocity)), float(np.linalg.norm(step)))
    return slower if slower > unsure else 0.0


def _hand_doubts(observation: Observation) -> list[str]:
    if not observation.controllers.shape[1]:
        return []
    steps = np.linalg.norm(np.diff(observation.controllers.astype(np.float64), axis=0), axis=2).max(1)
    speeds = steps / np.diff(observation.times)
    fastest = int(speeds.argmax())
    if speeds[fastest] <= HAND_FAST:
        return []
    return [
        f"controllers: one moves at {speeds[fastest]:.3g} m/s after frame {fastest}: a lost hand? "
        "The twin follows it"
    ]


def _size_doubts(observation: Observation) -> list[str]:
    size = object_size(observation.points)
    if size is None or size <= LARGE:
        return []
    return [f"points: the object measures {size:.3g} m: is it in centimetres?"]


def _gravity_doubts(observation: Observation) -> list[str]:
    gravity = tuple(float(value) for value in observation.gravity)
    if gravity[2] > 0.0:
        return [f"gravity points up ({gravity[2]:g} m/s² along z): the world is z up"]
    size = float(np.linalg.norm(gravity))
    if abs(size - 1.0) < UNIT:
        return [f"gravity: {size:.3g} m/s²: is it a direction alone? On Earth give (0, 0, -9.81)"]
    if size < WEAK:
        return [f"gravity: {size:.3g} m/s² pulls nothing down (9.81 on Earth): an object that hangs needs it"]
    if aslant(observation):
        return [f"gravity: {gravity} is far from downwards: is another axis than z up?"]
    return []


def aslant(observation: Observation) -> bool:
    """Whether gravity, where there is any, is further from downwards than a set-up is tilted."""
    size = float(np.linalg.norm(observation.gravity))
    return size >= WEAK and -observation.gravity[2] < float(np.cos(ASLANT)) * size


def _grip_doubts(observation: Observation) -> list[str]:
    away = _nearest_controller(observation)
    if away is None or away <= _reach(observation):
        return []
    return [f"controllers: the nearest is {away:.3g} m from any point in the first frame: it holds none"]


def _nearest_controller(observation: Observation) -> float | None:
    """How far the nearest controller is from what is seen in the first frame [m]; None: there is none."""
    held, first = observation.controllers[0], observation.points[0]
    first = first[~np.isnan(first[:, 0])]
    if not len(held):
        return None
    if not len(first):
        return 0.0  # nothing is seen that could be far from it
    return float(np.linalg.norm(held[:, None] - first[None], axis=2).min())


def _reach(observation: Observation) -> float:
    return max(REACH, 0.5 * (object_size(observation.points) or 0.0))


def hangs(observation: Observation) -> bool:
    """Whether the object is in the air, held by nothing, and does not fall."""
    gravity = np.asarray(observation.gravity)
    size = object_size(observation.points)
    away = _nearest_controller(observation)
    held = away is not None and away <= _reach(observation)
    if held or size is None or np.linalg.norm(gravity) < 1e-6:
        return False
    points = observation.points[..., 2]
    seen = ~np.isnan(points).all(axis=1)
    in_air = seen.copy()
    if observation.ground_height is not None:
        lowest = np.nanmin(points[seen], axis=1)
        in_air[seen] = lowest > observation.ground_height + AIRBORNE * size
    for start, end in _runs(in_air):
        times = observation.times[start:end]
        if times[-1] - times[0] >= FLIGHT:
            fallen = _fall(observation.points[start:end], gravity)
            # it may have been thrown: from the top on it falls, and before that it would if time went back
            top = int(fallen.argmin())
            far = 0 if 2.0 * times[top] > times[0] + times[-1] else len(times) - 1
            spent = DRAG * abs(float(times[far] - times[top]))
            slowed = float(np.linalg.norm(gravity)) * (spent - 1.0 + np.exp(-spent)) / DRAG**2
            if fallen[far] - fallen[top] < min(HANGING * slowed, LOWERED * size):
                return True
    return False


def _runs(flags: Bool[Array, " T"]) -> list[tuple[int, int]]:
    """Start and end of each run of true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(start), int(end)) for start, end in edges.reshape(-1, 2)]


def _fall(points: Float[Array, "T N 3"], gravity: Float64[Array, " 3"]) -> Float64[Array, " T"]:
    """Mean distance fallen along gravity [m], each point counted from its own middle position."""
    along = np.asarray(points, np.float64) @ (gravity / np.linalg.norm(gravity))
    kept = along[:, ~np.isnan(along).all(axis=0)]
    fallen: Float64[Array, " T"] = np.nanmean(kept - np.nanmedian(kept, axis=0), axis=1)
    return fallen
