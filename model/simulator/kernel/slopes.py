"""How the forces of a kernel change with places and velocities: products with the transposed Jacobian."""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from model.simulator.kernel.call import Buffers, Call, Interval, point_rows, state_rows
from model.simulator.kernel.layout import LANES
from model.simulator.kernel.program import HALF, Program, corner_rows, first_rows, piece_rows
from model.simulator.system import Anchors, State

UNIT = Interval(dt=1.0, count=1, seconds=1.0, lasts=0.0)
"""One substep whose adjoint is u ↦ (∂a/∂x)ᵀu, u + (∂a/∂v)ᵀu, with a = F/m; what is remembered has no time to
change."""


class Slopes:
    """Products with the transposed Jacobian of the accelerations at one state, as `stable_step` asks for.

    Args:
        program: A kernel.
        values: Its constants.
        state: Where to linearise [m, m/s], [B, N, 3].
        anchors: Where the controllers are.
        memories: What laws remember there, [1 or B, e] each.
    """

    def __init__(
        self,
        program: Program,
        values: Buffers,
        state: State,
        anchors: Anchors | None,
        memories: Sequence[Tensor] = (),
    ) -> None:
        """See the class."""
        self._program = program
        count, points = len(state.positions), point_rows(program.layout)
        rows = state.positions.new_zeros(count, 2, state_rows(program.layout), LANES)
        rows[:, 0] = first_rows(program, state.positions.detach(), state.velocities.detach())
        if anchors is not None:
            rows[:, 0, points:, :3] = anchors.positions.detach()
            rows[:, 0, points:, 3:6] = anchors.velocities.detach()
        self._adjoint = rows.new_zeros(count, points, LANES)
        single = {**values.single, "factor": rows.new_ones(1, points), "rows": rows, "adjoint": self._adjoint}
        single["pulls"] = rows.new_zeros(2, count, points, HALF)
        single["sums"] = piece_rows(program, rows, LANES)
        single |= corner_rows(program, rows[:, 0], corner_adjoints=LANES)
        kinds = zip(memories, program.memories, strict=True)
        remembered = [program.spread(m.detach(), kind).expand(count, -1).contiguous() for m, kind in kinds]
        self._forgotten = [torch.zeros_like(memory) for memory in remembered]
        lists: dict[str, Sequence[Tensor | None]] = {
            "memory": remembered,
            "memory_adjoint": self._forgotten,
            "edge_gradient": [None] * len(program.edges),
            "scene_gradient": [None] * len(program.scenes),
        }
        whole = {"first": 0, "steps": 1, "ring": 2, "keep": 1}
        buffers = Buffers(single, {**values.lists, **lists})
        self._call = Call(program.library, "backward", program.graphs, UNIT, buffers, whole, count)

    def __call__(
        self, vector: Float[Tensor, "*b N 3"]
    ) -> tuple[Float[Tensor, "*b N 3"], Float[Tensor, "*b N 3"]]:
        """(∂a/∂x)ᵀu and (∂a/∂v)ᵀu of u = `vector`, with a the accelerations [m/s²]."""
        layout, count = self._program.layout, len(self._adjoint)
        for adjoint in (self._adjoint, *self._forgotten):
            adjoint.zero_()
        # rows that only fill up hear of point 0 what they pass on to nobody
        self._adjoint[:, :, 3:6] = vector.reshape(count, -1, 3).index_select(1, layout.point)
        self._call()
        back = self._adjoint.index_select(1, layout.row)
        by_place, by_velocity = back[..., :3].reshape(vector.shape), back[..., 3:6].reshape(vector.shape)
        return by_place, by_velocity - vector
