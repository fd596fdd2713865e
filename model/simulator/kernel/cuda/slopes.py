"""How the forces of a CUDA kernel change with places and velocities."""

import torch
from jaxtyping import Float
from torch import Tensor

from model.simulator.kernel.cuda.frame import Values
from model.simulator.kernel.cuda.program import ROW, Program, first_rows, retreat
from model.simulator.kernel.program import History
from model.simulator.kernel.slopes import UNIT
from model.simulator.system import Anchors, State


class Slopes:
    """Products with the transposed Jacobian of the accelerations at one state, as `stable_step` asks for.

    Args:
        program: A kernel whose laws remember nothing.
        values: Its constants.
        state: Where to linearise [m, m/s], [B, N, 3].
        anchors: Where the controllers are.
    """

    def __init__(self, program: Program, values: Values, state: State, anchors: Anchors | None) -> None:
        """See the class."""
        self._program = program
        start = first_rows(program, state.positions.detach(), state.velocities.detach())
        rows = start.new_zeros(len(start), 2, program.points, ROW)
        rows[:, 0] = start
        self._history = History(0, 1, rows, ())
        self._values = {**values, "factor": rows.new_ones(1, program.points)}
        if anchors is not None:
            # the substep ends where they are, and its one second began where they came from
            after = anchors.positions.detach()
            before = after - anchors.velocities.detach()
            self._values |= {"before": before.contiguous(), "after": after.contiguous()}

    def __call__(
        self, vector: Float[Tensor, "*b N 3"]
    ) -> tuple[Float[Tensor, "*b N 3"], Float[Tensor, "*b N 3"]]:
        """(∂a/∂x)ᵀu and (∂a/∂v)ᵀu of u = `vector`, with a the accelerations [m/s²]."""
        layout, count = self._program.layout, len(self._history.rows)
        flat = vector.reshape(count, -1, 3).index_select(1, layout.point)
        adjoint = torch.cat([torch.zeros_like(flat), flat], -1)
        pulls = [adjoint.new_empty(count, self._program.points, 4) for _ in range(2)]
        values = {**self._values, "adjoint": adjoint, "pulls": pulls}
        retreat(self._program, UNIT, values, self._history)
        back = adjoint.index_select(1, layout.row)
        by_place, by_velocity = back[..., :3].reshape(vector.shape), back[..., 3:].reshape(vector.shape)
        return by_place, torch.sub(by_velocity, vector)
