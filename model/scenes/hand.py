"""A right hand that pinches something, with its forearm and sleeve."""

import numpy as np

from model.scenes.capsules import chain, union
from model.scenes.splats import Coat, coat, joined

SPACING, SLEEVE_SPACING = 0.0036, 0.008
"""Between surface Gaussians [m]."""
SKIN, FINGERTIP, SLEEVE = (
    np.array([0.80, 0.59, 0.48]),
    np.array([0.83, 0.55, 0.46]),
    np.array([0.20, 0.22, 0.30]),
)

INDEX = chain(
    (-0.014, 0.060, 0.062, 0.0105),
    (-0.013, 0.030, 0.060, 0.0092),
    (-0.003, 0.008, 0.040, 0.0085),
    (0.002, -0.004, 0.023, 0.0075),
)
MIDDLE = chain(
    (-0.001, 0.066, 0.068, 0.0108),
    (-0.002, 0.036, 0.062, 0.0095),
    (0.006, 0.020, 0.040, 0.0085),
    (0.008, 0.020, 0.026, 0.0078),
)
RING = chain(
    (0.014, 0.070, 0.066, 0.0102),
    (0.014, 0.044, 0.056, 0.0092),
    (0.020, 0.034, 0.036, 0.0082),
    (0.020, 0.042, 0.024, 0.0076),
)
LITTLE = chain((0.028, 0.076, 0.060, 0.0092), (0.029, 0.056, 0.048, 0.0082), (0.032, 0.050, 0.034, 0.0074))
THUMB = chain(
    (-0.020, 0.092, 0.060, 0.0140),
    (-0.030, 0.058, 0.042, 0.0115),
    (-0.024, 0.022, 0.030, 0.0098),
    (-0.012, 0.004, 0.014, 0.0085),
)
PALM = union(
    chain((-0.013, 0.062, 0.062, 0.0125), (-0.006, 0.128, 0.092, 0.0190)),
    chain((0.000, 0.068, 0.067, 0.0130), (0.004, 0.130, 0.094, 0.0200)),
    chain((0.014, 0.072, 0.065, 0.0125), (0.012, 0.132, 0.094, 0.0190)),
    chain((0.027, 0.078, 0.060, 0.0115), (0.018, 0.132, 0.092, 0.0180)),
)
FOREARM = chain((0.006, 0.130, 0.093, 0.0230), (0.012, 0.180, 0.122, 0.0260), (0.022, 0.300, 0.190, 0.0370))
SLEEVE_TUBE = chain(
    (0.022, 0.300, 0.190, 0.0430), (0.050, 0.620, 0.360, 0.0560), (0.075, 0.900, 0.520, 0.0650)
)
UPPER_ARM = chain((0.075, 0.900, 0.520, 0.0650), (0.140, 1.700, 0.980, 0.0800))
"""Behind the end of the sleeve, where a camera sees that far."""
PARTS = (INDEX, MIDDLE, RING, LITTLE, THUMB, PALM, FOREARM)


def hand_coat(
    rng: np.random.Generator, spacing: float = SPACING, sleeve_spacing: float = SLEEVE_SPACING
) -> Coat:
    """Its Gaussians, where the pinched point is the origin and the arm leaves backwards (+y) and up.

    Args:
        rng: For the texture of skin and sleeve.
        spacing: Between the Gaussians on the skin [m].
        sleeve_spacing: Between those on the sleeve [m].
    """
    body = union(*PARTS)
    surface = body.surface(spacing)
    owner, along = body.owners(surface)
    tips = np.cumsum([len(part.starts) for part in PARTS[:5]]) - 1
    reddened = np.where(np.isin(owner, tips), along, 0.0)[:, None]
    albedo = SKIN + reddened * (FINGERTIP - SKIN)
    mottled = np.sin(surface[:, 0] * 190) * np.sin(surface[:, 1] * 170) * np.sin(surface[:, 2] * 180)
    albedo *= (1 + 0.04 * mottled + rng.normal(0, 0.015, len(surface)))[:, None]
    skin = coat(body, np.clip(albedo, 0, 1), surface, spacing, rng)
    return joined(skin, _sleeve(rng, sleeve_spacing))


def upper_arm(rng: np.random.Generator, spacing: float) -> Coat:
    """The rest of the sleeve, its discs about `spacing` [m] apart."""
    surface = UPPER_ARM.surface(spacing)
    folds = 1 + 0.12 * np.sin(surface[:, 1] * 40 + 3 * np.sin(surface[:, 0] * 30))
    return coat(UPPER_ARM, folds[:, None] * SLEEVE, surface, spacing, rng)


def _sleeve(rng: np.random.Generator, spacing: float) -> Coat:
    surface = SLEEVE_TUBE.surface(spacing)
    folds = 1 + 0.12 * np.sin(surface[:, 1] * 70 + 3 * np.sin(surface[:, 0] * 40))
    return coat(SLEEVE_TUBE, folds[:, None] * SLEEVE, surface, spacing, rng)
