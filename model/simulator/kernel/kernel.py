"""The fast path of a rollout: its terms as one compiled kernel."""

from collections.abc import Mapping
from dataclasses import replace

import torch
from torch import Tensor

from model.simulator.dynamics import Dynamics
from model.simulator.integrators.base import Integrator
from model.simulator.kernel.build import CannotBuild, load
from model.simulator.kernel.call import Buffers, Interval
from model.simulator.kernel.emit import TYPES, kernel_source
from model.simulator.kernel.function import NAMED, FrameFunction, Task
from model.simulator.kernel.layout import cut, lay_out, lay_out_stencils
from model.simulator.kernel.program import Program
from model.simulator.kernel.slopes import Slopes
from model.simulator.kernel.terms import Inexpressible, Terms
from model.simulator.system import Anchors, State


class Kernel:
    """All terms of a dynamics, compiled, with their constants as the kernel reads them.

    Args:
        dynamics: The terms and their constants.
        integrator: How time advances.
        batch: Leading dimensions of the states that will come.

    Raises:
        Inexpressible: a term, the integrator or the device that no kernel knows, or no compiler; says which.
    """

    def __init__(self, dynamics: Dynamics, integrator: Integrator, batch: torch.Size) -> None:
        """See the class."""
        dtype, device = dynamics.mass.dtype, dynamics.mass.device.type
        if device != "cpu" or dtype not in TYPES:
            raise Inexpressible(f"it does not compute in {dtype} on {device}")
        self._terms = terms = Terms(dynamics, integrator, batch)
        try:
            library = load(kernel_source(terms.groups, terms.corners, terms.ground, dtype))
        except CannotBuild as error:
            raise Inexpressible(str(error)) from error
        edges = dynamics.system.edges
        self._program = Program(
            library,
            lay_out(edges),
            cut(edges),
            lay_out_stencils(edges, terms.stencils) if terms.stencils else None,
            terms.edge_acts,
            terms.scene_acts,
            terms.memory_kinds,
        )
        with torch.no_grad():
            self._packed = [
                self._program.spread(v, k) for v, k in zip(terms.edges, terms.edge_acts, strict=True)
            ]
        self._timed = dict[float, tuple[dict[str, Tensor], Buffers]]()

    def advance(
        self, state: State, controls: tuple[Tensor, Tensor] | None, interval: Interval, keeps: bool
    ) -> State:
        """The state [m, m/s] one frame on.

        Args:
            state: At the start of the frame.
            controls: Where the controllers are at its start and end [m], [*b, C, 3].
            interval: Length and number of substeps.
            keeps: Keep every substep for the backward pass, instead of running the frame again there.
        """
        shape = state.positions.shape
        start = [
            value.reshape(self._terms.count, *shape[-2:]) for value in (state.positions, state.velocities)
        ]
        none = state.positions.new_zeros(1, 0, 3)
        held = (none, none) if controls is None else tuple(self._terms.flat(c.flatten(-2)) for c in controls)
        memories = [
            self._terms.flat(state.memory[f"{term}.{name}"]).expand(self._terms.count, -1)
            for term, name in self._terms.memory
        ]
        given, values = self._at(interval.dt)
        task = Task(self._program, values, interval, keeps)
        ended = FrameFunction.apply(  # type: ignore[no-untyped-call]
            task,
            *(value.contiguous() for value in start),
            *(h.reshape(len(h), -1, 3).expand(self._terms.count, -1, -1) for h in held),
            *(given[name] for name in NAMED[4:]),
            *self._terms.edges,
            *self._terms.scenes,
            *memories,
        )
        after = {
            f"{term}.{name}": value.reshape(*self._terms.batch, -1)
            for (term, name), value in zip(self._terms.memory, ended[2:], strict=True)
        }
        return replace(
            state, positions=ended[0].reshape(shape), velocities=ended[1].reshape(shape), memory=after
        )

    def slopes(self, state: State, anchors: Anchors | None) -> Slopes | None:
        """Products with the transposed Jacobian of the accelerations at a state [m, m/s], [*b, N, 3].

        None where a law remembers: what it does then depends on how long a step is.
        """
        if self._terms.memory:
            return None
        flat = [value.reshape(self._terms.count, -1, 3) for value in (state.positions, state.velocities)]
        if anchors is not None:
            held = [self._terms.flat(a.flatten(-2)) for a in (anchors.positions, anchors.velocities)]
            anchors = Anchors(*(h.reshape(len(h), -1, 3) for h in held))
        _, values = self._at(1.0)
        return Slopes(self._program, values, State(flat[0], flat[1]), anchors)

    def _at(self, dt: float) -> tuple[dict[str, Tensor], Buffers]:
        """The values of points for substeps of `dt` [s], and all constants as the kernel reads them."""
        if dt not in self._timed:
            made = self._terms.point_values(dt)
            self._timed[dt] = made, self._buffers(made)
        return self._timed[dt]

    def _buffers(self, given: Mapping[str, Tensor]) -> Buffers:
        point = self._program.layout.point
        single = {name: value.index_select(1, point) for name, value in given.items() if name != "gravity"}
        single["gravity"] = given["gravity"]
        if self._terms.scenes:
            most = max(len(value) for value in self._terms.scenes)
            single["scene"] = torch.cat([value.expand(most, -1) for value in self._terms.scenes], -1)
        return Buffers(
            {name: value.detach().contiguous() for name, value in single.items()}, {"edge": self._packed}
        )
