"""Effects that can act in a recording: whether parts that are far apart at rest ever come near each other."""

import numpy as np

from model.gap.bodies.first import first_places
from model.gap.effects import ALL_EFFECTS
from model.gap.effects.base import Effect
from model.gap.effects.self_collision import SelfContact
from model.gap.study import Study

APART, NEAR = 3.6, 1.0
"""Grasps: at rest, and when they may touch."""
EVERY = 4
"""Frames."""
PAIRS = 2
"""Fewer may be a wrong track."""


def able_effects(study: Study) -> list[Effect]:
    """What a fitted twin may lack: juries are trained on these and diagnoses try these."""
    world = study.plain.at(study.base.values)
    every: list[Effect] = [kind() for kind in ALL_EFFECTS]
    able = [effect.within(world) for effect in every if effect.unable(world) is None]
    return [effect for effect in able if not isinstance(effect, SelfContact) or may_meet(study)]


def may_meet(study: Study) -> bool:
    """From what was seen alone: an object that never touches itself shows nothing of self-collision."""
    grasp = study.plain.twin.body.grasp
    rest = first_places(study.observation)
    apart = np.linalg.norm(rest[:, None] - rest[None], axis=-1) > APART * grasp
    points = study.observation.points.astype(np.float64)
    for frame in points[::EVERY]:
        near = np.linalg.norm(frame[:, None] - frame[None], axis=-1) < NEAR * grasp
        if int((near & apart).sum()) >= 2 * PAIRS:
            return True
    return False
