"""A contact as a spring and a damper, for simulators that know no impact."""

import numpy as np

STIFF = 0.5
"""Frequency of the contact's spring times the time step: as hard as a step follows without ringing."""
PHASES = 64
"""Places within a step at which a mass may meet the contact."""
LONGEST = 400
"""Steps after which a mass that has not left stays."""


def soft_contact(restitution: float, step: float) -> tuple[float, float]:
    r"""Stiffness ω² [1/s²] and damping c [1/s], each per mass, of a contact with that restitution.

    A mass that meets a spring and a damper, in steps of semi-implicit Euler, leaves when they push no more.
    The damping is the one with which it keeps the share e of its speed, on average over where within a step
    it meets them. For long contacts that is the closed form of the reference; here a contact is as short as
    the steps allow.

    Args:
        restitution: e [1].
        step: Of the simulator [s].

    Reference:
        Schwager and Pöschel (2007), Coefficient of restitution and linear-dashpot model revisited, Granular
        Matter 9, 465.
    """
    low, high = 0.0, 1.0
    for _ in range(40):
        damping = (low + high) / 2
        low, high = (damping, high) if _kept(damping) > restitution else (low, damping)
    return (STIFF / step) ** 2, high / step


def _kept(damping: float) -> float:
    """Share of the speed kept, in units of the step, averaged over the phases."""
    place, speed = np.linspace(0.0, -1.0, PHASES, endpoint=False), np.full(PHASES, -1.0)
    for _ in range(LONGEST):
        touching = place < 0
        if not (touching | (speed < 0)).any():
            break
        push = np.where(touching, np.maximum(-(STIFF**2) * place - damping * speed, 0.0), 0.0)
        speed = speed + push
        place = place + speed
    return float(np.where(place >= 0, speed, 0.0).mean())
