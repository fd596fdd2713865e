"""The law of impact with friction, shared by all contacts."""

import torch

from model.simulator.forces.base import Scalar


def coulomb(approach: Scalar, slip: Scalar, restitution: Scalar, friction: Scalar) -> tuple[Scalar, Scalar]:
    r"""What an impact makes of the velocity that two surfaces have relative to each other.

    $v_n' = -e\,v_n$, and $v_t' = v_t\,\max(0,\ 1 - \mu(1+e)|v_n|/|v_t|)$: the tangential impulse is at most
    $\mu$ times the normal one, and never more than stops the slip.

    Args:
        approach: $|v_n|$ of surfaces that come closer [m/s], positive.
        slip: $|v_t|$ [m/s], positive.
        restitution: e [1].
        friction: $\mu$ [1].

    Returns:
        The speed at which the surfaces separate [m/s], and the factor on the tangential velocity.

    Reference:
        Bridson, Fedkiw and Anderson (2002), Robust treatment of collisions, contact and friction for cloth
        animation, SIGGRAPH '02 (the friction impulse), with the normal impulse of an inelastic impact.
    """
    return restitution * approach, torch.clamp(
        1.0 - friction * (1.0 + restitution) * approach / slip, min=0.0
    )
