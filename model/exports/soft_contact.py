"""An impact as a spring and a damper, for simulators that know no impact."""

import numpy as np

STIFF = 0.07
"""Stiffness of the contact [mass per step squared]: what rests on it sinks by 14 g dt², and what meets it is
not thrown back by it."""
PHASES = 64
"""Places within a step at which a mass may meet the contact."""
LONGEST = 400
"""Steps after which a mass that has not left stays."""


def soft_contact(restitution: float, step: float) -> tuple[float, float]:
    r"""Stiffness [1/s²] and damping [1/s], each per mass, of a contact with that restitution.

    An impact turns the speed v into -e v at once. So does, in a step of semi-implicit Euler, a damper of
    about (1 + e)/dt; the spring beside it bears what rests. The damping is the one with which a mass keeps
    the share e of its speed, on average over where within a step it meets the contact. (Weaker dampers, whose
    contacts last for many steps, have the reference's closed form; but springs of the object then act while
    it lasts, and it bounces otherwise.)

    Args:
        restitution: e [1]; the least that can be had is 0.035.
        step: Of the simulator [s].

    Reference:
        Schwager and Pöschel (2007), Coefficient of restitution and linear-dashpot model revisited, Granular
        Matter 9, 465.
    """
    low, high = 1.0, 2.0
    for _ in range(40):
        damping = (low + high) / 2
        low, high = (damping, high) if kept(damping) < restitution else (low, damping)
    return STIFF / step**2, low / step


def kept(damping: float) -> float:
    """Share of the speed kept by a damping [per step], averaged over the phases."""
    place, speed = np.linspace(0.0, -1.0, PHASES, endpoint=False), np.full(PHASES, -1.0)
    for _ in range(LONGEST):
        touching = place < 0
        if not (touching | (speed < 0)).any():
            break
        push = np.where(touching, np.maximum(-STIFF * place - damping * speed, 0.0), 0.0)
        speed = speed + push
        place = place + speed
    return float(np.where(place >= 0, speed, 0.0).mean())
