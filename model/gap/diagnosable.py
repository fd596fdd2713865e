"""Whether an observation can be diagnosed at all, and whether another one can confirm what it says."""

import numpy as np
from jaxtyping import Float32

from model.errors import InputError
from model.gap.bodies.let_go import NOISY
from model.gap.noise import noise_of
from model.gap.same_points import same_points
from model.gap.study import HELD_OUT, PATIENCE
from model.gap.transfer import LOOKED_AT, SETTLING
from model.observation_doubts import LONG_STEP, SHORT, aslant, hangs, object_size
from model.types import Array, Observation

FRAMES = 12
"""A diagnosis fits to the first two thirds and predicts the rest; fewer leave too little of both."""
POINTS = 3
"""Fewer have no shape."""
FITTED, FORETOLD, FOUND = 6, 3, 2
"""Frames in which enough points are seen, at least: of those a fit sees, of those that it foretells, and of
those by which the object is found in another recording."""
PAUSE = 10.0
"""Times as long as the usual interval: all frames would be simulated as finely as the longest needs."""
BURIED = 0.25
"""Share of its size by which the middle of an object may be below the ground: heights are measured badly."""
REPEATED = 0.5
"""Share of frames of the first recording in another one above which that is a part of the first."""
SAME, ASKED = 0.3, 64
"""A frame is the same again where points are nearer than so much of the noise, which two measurements of one
motion are not; and the points that are asked."""
LOST = 0.05
"""How far [m] a track that is at the origin in some frames alone is from there in the next, to be lost."""


def check_diagnosable(observation: Observation, name: str) -> None:
    """Refuse what would give a verdict that means nothing.

    Args:
        observation: Within its contract.
        name: What the message calls it.

    Raises:
        InputError: too little to see forces by - frames, points, time between frames -, or to judge by what
            is foretold, tracks that jump to the origin, a pause between frames, gravity that points up, a
            ground above the object, or an object in the air that nothing holds and that does not fall.
    """
    check_enough(observation, name)
    _check_lost(observation, name)
    _check_pauses(observation, name)
    _check_split(observation, max(3, round((1.0 - HELD_OUT) * len(observation.times))), FITTED, name)
    if observation.gravity[2] > 0.0:
        raise InputError(
            f"{name}: gravity: expected it to point down, found {observation.gravity[2]:g} m/s² along z: "
            "the world is z up, turn points and controllers with it"
        )
    if aslant(observation) and observation.ground_height is not None:
        raise InputError(
            f"{name}: gravity: expected it to point down onto the ground of constant z, found "
            f"{observation.gravity}: the world is z up, turn points and controllers with it"
        )
    _check_ground(observation, name)
    if hangs(observation):
        raise InputError(
            f"{name}: controllers: expected the hand that holds the object, or ground_height where it lies: "
            "found neither near it, and it does not fall; no cause can be told from what is missing here"
        )


def stays_within(observation: Observation) -> float | None:
    """How far [m] anything gets that does not move by more than noise does; None: something does.

    What an object is made of, and what acts on it, shows in how it moves alone.
    """
    limit = NOISY * noise_of(observation)
    for places in (observation.points, observation.controllers):
        tracks = places[:, np.isfinite(places[..., 0]).any(0)].astype(np.float64)
        if tracks.shape[1] and np.nanmax(np.abs(tracks - np.nanmedian(tracks, axis=0))) > limit:
            return None
    return limit


def check_moves(observation: Observation, name: str) -> None:
    """Refuse to diagnose what does not move.

    Args:
        observation: Within its contract.
        name: What the message calls it.

    Raises:
        InputError: nothing moves by more than noise does.
    """
    limit = stays_within(observation)
    if limit is not None:
        raise InputError(
            f"{name}: points: expected an object that moves, found all within {1e3 * limit:.2g} mm, as noise "
            "is: what it lacks shows in motion alone"
        )


def check_transfer(observation: Observation, transfer: Observation, name: str) -> None:
    """Refuse another recording that can confirm nothing.

    Args:
        observation: What is diagnosed.
        transfer: What is to confirm it, both within their contract.
        name: What the message calls it.

    Raises:
        InputError: it is the same recording, or too little is seen in it.
    """
    settled = int(np.searchsorted(transfer.times - transfer.times[0], SETTLING * PATIENCE))
    first = min(max(settled, round(LOOKED_AT * len(transfer.times))), len(transfer.times) // 2)
    _check_split(transfer, first, FOUND, name)
    if _repeated(observation, transfer) > REPEATED:
        raise InputError(
            f"{name}: points: expected another interaction with the object, found the same motion again, "
            "which confirms nothing: leave it out, or give another recording"
        )


def _repeated(observation: Observation, transfer: Observation) -> float:
    """Share of the frames of another recording that are frames of the first, but for rounding.

    Told by points that both show, else by the hand, in frames in which it moves.
    """
    limit = SAME * noise_of(observation)
    if same_points(observation, transfer):
        count = observation.points.shape[1]
        asked = np.unique(np.linspace(0, count - 1, min(count, ASKED)).astype(int))
        return _again(_shown(observation)[:, asked], _shown(transfer)[:, asked], limit)
    known, again = observation.controllers, transfer.controllers
    if not again.shape[1] or known.shape[1] != again.shape[1]:
        return 0.0
    moves = np.linalg.norm(np.diff(again, axis=0), axis=-1).max(1) > limit
    return _again(known, again[1:][moves], limit)


def _again(known: Float32[Array, "F n 3"], again: Float32[Array, "G n 3"], limit: float) -> float:
    """Share of some frames that are nearer to one of others than a limit [m]."""
    nearest = []
    for frame in again:
        away = np.linalg.norm(known - frame, axis=-1)
        away = away[np.isfinite(away).any(1)]
        nearest.append(float(np.nanmedian(away, axis=1).min()) if len(away) else np.inf)
    return float(np.mean(np.array(nearest) <= limit)) if nearest else 0.0


def _shown(observation: Observation) -> Float32[Array, "F N 3"]:
    """The frames in which anything is seen."""
    shown: Float32[Array, "F N 3"] = observation.points[np.isfinite(observation.points[..., 0]).any(1)]
    return shown


def check_enough(observation: Observation, name: str) -> None:
    """Refuse what has too few frames, points or seconds in which something is seen.

    Args:
        observation: Within its contract.
        name: What the message calls it.

    Raises:
        InputError: it has too few.
    """
    times, seen = observation.times, np.isfinite(observation.points[..., 0])
    if len(times) < FRAMES:
        raise InputError(f"{name}: times: expected at least {FRAMES} frames to diagnose, found {len(times)}")
    step, span = float(np.median(np.diff(times))), float(times[-1] - times[0])
    if step > LONG_STEP:
        raise InputError(
            f"{name}: times: expected at most {LONG_STEP:g} s between frames to diagnose, found {step:.3g}: "
            "numbers of frames?"
        )
    if span < SHORT:
        raise InputError(f"{name}: times: expected at least {SHORT:g} s to diagnose, found {span:.3g}")
    ever = int(seen.any(0).sum())
    if ever < POINTS:
        raise InputError(
            f"{name}: points: expected at least {POINTS} that are seen to diagnose, found {ever}"
        )
    frames = int((seen.sum(1) >= POINTS).sum())
    if frames < FRAMES:
        raise InputError(
            f"{name}: points: expected {POINTS} or more seen in at least {FRAMES} frames to diagnose, "
            f"found {frames} such frames"
        )


def _check_lost(observation: Observation, name: str) -> None:
    """Trackers write zeros where they see nothing, and those are not places."""
    advice = {"points": "write NaN where a point is not seen", "controllers": "fill in where the hand was"}
    for key, places in (("points", observation.points), ("controllers", observation.controllers)):
        zero = (places == 0.0).all(-1)
        away = np.nan_to_num(np.linalg.norm(np.diff(places, axis=0), axis=-1))
        lost = ((zero[1:] != zero[:-1]) & (away > LOST)).any(0)
        if lost.any():
            share = float(zero[:, lost].sum() / np.isfinite(places[..., 0]).sum())
            raise InputError(
                f"{name}: {key}: expected places, found {int(lost.sum())} that jump to (0, 0, 0) "
                f"({100.0 * share:.2g} % of all that is seen): {advice[key]}"
            )


def _check_pauses(observation: Observation, name: str) -> None:
    """What moved while nobody looked cannot be told, and takes very long to simulate."""
    steps = np.diff(observation.times)
    usual = float(np.median(steps))
    pauses = np.flatnonzero(steps > max(PAUSE * usual, LONG_STEP))
    if not len(pauses):
        return
    begins, ends = np.append(0, pauses + 1), np.append(pauses, len(steps))
    longest = int((ends - begins).argmax())
    one, other, begin, end = (
        f"{observation.times[frame]:.6g}"
        for frame in (pauses[0], pauses[0] + 1, begins[longest], ends[longest])
    )
    raise InputError(
        f"{name}: times: expected frames about {usual:.3g} s apart, found a pause from {one} to {other} s: "
        f"give the longest part alone, from {begin} to {end} s"
    )


def _check_split(observation: Observation, first: int, least: int, name: str) -> None:
    """Enough has to be seen before the first frame that is foretold, and after it."""
    shown = np.isfinite(observation.points[..., 0]).sum(1) >= POINTS
    when = f"{observation.times[first] - observation.times[0]:.3g} s"
    parts = (
        (shown[:first], least, f"before {when}, to which a twin is fitted"),
        (shown[first:], FORETOLD, f"from {when} on, which a twin foretells"),
    )
    for part, wanted, which in parts:
        if part.sum() < wanted:
            raise InputError(
                f"{name}: points: expected {POINTS} or more seen in at least {wanted} of the frames {which}, "
                f"found {part.sum()} such frames"
            )


def _check_ground(observation: Observation, name: str) -> None:
    ground, size = observation.ground_height, object_size(observation.points)
    if ground is None or size is None:
        return
    height = float(np.nanmedian(observation.points[..., 2]))
    if height < ground - BURIED * size:
        raise InputError(
            f"{name}: ground_height: expected a ground under the object, found {ground:.3g} m, the object "
            f"at {height:.3g} m: is z up?"
        )
