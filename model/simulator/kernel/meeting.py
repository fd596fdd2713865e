"""What a kernel needs to know of an object that may meet itself."""

import torch
from jaxtyping import Int
from torch import Tensor

from model.simulator.contacts.self_collision import SelfCollision
from model.simulator.kernel.layout import Layout
from model.simulator.kernel.terms import Terms
from model.simulator.parameters import Values


def meeting_buffers(
    terms: Terms, layout: Layout, contact: SelfCollision, values: Values
) -> dict[str, Tensor]:
    """By the field of `Frame`: who may meet, and how.

    Args:
        terms: Of the kernel.
        layout: Where its points are.
        contact: The term.
        values: Its constants.
    """
    system = terms.dynamics.system
    distance = contact.distance.to(system.points)
    law = [distance.square(), values["restitution"], values["friction"]]
    columns = [terms.flat(value if value.ndim else value.unsqueeze(-1)) for value in law]
    most = max(len(column) for column in columns)
    start, joined = _neighbours(layout.row[system.springs], len(layout.row))
    return {
        "meeting": torch.cat([column.expand(most, 1) for column in columns], 1).detach().contiguous(),
        "rest": system.points[layout.point[: len(layout.row)]].unsqueeze(0).contiguous(),
        "joined_start": start.unsqueeze(0),
        "joined": joined.unsqueeze(0),
    }


def _neighbours(pairs: Int[Tensor, "e 2"], count: int) -> tuple[Int[Tensor, " n"], Int[Tensor, " e"]]:
    """To which later points each of `count` is joined: where its list begins, and all lists in a row."""
    low, high = pairs.amin(1), pairs.amax(1)
    order = low.argsort()
    start = torch.zeros(count + 1, dtype=torch.int64)
    start[1:] = torch.bincount(low, minlength=count).cumsum(0)
    return start, high[order].int().contiguous()
