"""The fast path of a rollout: its terms as one compiled kernel."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import torch
from torch import Tensor

from model.simulator.contacts.self_collision import SelfCollision
from model.simulator.dynamics import Dynamics
from model.simulator.integrators.base import Integrator
from model.simulator.kernel.abreast import Abreast, lanes_of, pays
from model.simulator.kernel.build import CannotBuild, load
from model.simulator.kernel.call import Buffers, Interval
from model.simulator.kernel.emit import TYPES, kernel_source
from model.simulator.kernel.function import NAMED, FrameFunction, Task
from model.simulator.kernel.layout import cut, lay_out, lay_out_stencils
from model.simulator.kernel.meeting import meeting_buffers
from model.simulator.kernel.program import Program, Repeated
from model.simulator.kernel.slopes import Slopes
from model.simulator.kernel.terms import Inexpressible, Terms
from model.simulator.parameters import Values
from model.simulator.system import Anchors, State

LENGTHS = 4
"""Of frames that are kept ready: times are often rounded, so that two or three take turns."""


class Kernel:
    """All terms of a dynamics, compiled, with their constants as the kernel reads them.

    Args:
        dynamics: The terms and their constants.
        integrator: How time advances.
        batch: Leading dimensions of the states that will come.
        meeting: How the object meets itself, before it meets anything else; only in frames without gradients.

    Raises:
        Inexpressible: a term, the integrator or the device that no kernel knows, or no compiler; says which.
    """

    def __init__(
        self,
        dynamics: Dynamics,
        integrator: Integrator,
        batch: torch.Size,
        meeting: tuple[SelfCollision, Values] | None = None,
    ) -> None:
        """See the class."""
        dtype, device = dynamics.mass.dtype, dynamics.mass.device.type
        if device != "cpu" or dtype not in TYPES:
            raise Inexpressible(f"it does not compute in {dtype} on {device}")
        self._terms = terms = Terms(dynamics, integrator, batch)
        try:
            written = terms.groups, terms.corners, terms.ground, dtype
            library = load(kernel_source(*written))
            self._abreast = load(kernel_source(*written, abreast=True)) if terms.count > 1 else None
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
        constants = [*terms.edges, *terms.scenes, *terms.point_values(1.0).values()]
        constants += [] if meeting is None else meeting[1].values()
        self._learned = any(value.requires_grad for value in constants)
        layout = self._program.layout
        self._meeting = {} if meeting is None else meeting_buffers(terms, layout, *meeting)
        self._timed = dict[float, tuple[dict[str, Tensor], Buffers]]()
        self._ready = dict[Interval, Repeated | Abreast]()

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
        shape, terms = state.positions.shape, self._terms
        none = state.positions.new_zeros(1, 0, 3)
        held = (none, none) if controls is None else tuple(self._places(c) for c in controls)
        places = [value.reshape(terms.count, *shape[-2:]) for value in (state.positions, state.velocities)]
        memories = self._remembered(state)
        given, values = self._at(interval.dt)
        inputs = dict(zip(NAMED, (*places, *held), strict=False)) | given
        ended: Sequence[Tensor]
        if self.differentiates(*inputs.values(), *memories):
            task = Task(self._program, values, interval, keeps)
            whole = [inputs[name].contiguous() for name in NAMED[:2]]
            whole += [inputs[name].expand(terms.count, -1, -1) for name in NAMED[2:4]]
            whole += [inputs[name] for name in NAMED[4:]]
            remembered = [memory.expand(terms.count, -1) for memory in memories]
            ended = FrameFunction.apply(task, *whole, *terms.edges, *terms.scenes, *remembered)  # type: ignore[no-untyped-call]
        else:
            ended = self._repeated(interval, given, values)(inputs, memories)
        after = {
            f"{term}.{name}": value.reshape(*terms.batch, -1)
            for (term, name), value in zip(terms.memory, ended[2:], strict=True)
        }
        return replace(
            state, positions=ended[0].reshape(shape), velocities=ended[1].reshape(shape), memory=after
        )

    def differentiates(self, *inputs: Tensor) -> bool:
        """Whether gradients flow from a frame: to some of its inputs, or to a constant."""
        if not torch.is_grad_enabled():
            return False
        return self._learned or any(value.requires_grad for value in inputs)

    def slopes(self, state: State, anchors: Anchors | None) -> Slopes:
        """Products with the transposed Jacobian of the accelerations at a state [m, m/s], [*b, N, 3]."""
        flat = [value.reshape(self._terms.count, -1, 3) for value in (state.positions, state.velocities)]
        if anchors is not None:
            anchors = Anchors(self._places(anchors.positions), self._places(anchors.velocities))
        _, values = self._at(1.0)
        memories = self._remembered(state)
        return Slopes(self._program, values, State(flat[0], flat[1]), anchors, memories)

    def _remembered(self, state: State) -> list[Tensor]:
        """What laws remember, [1 or B, e] each."""
        return [self._terms.flat(state.memory[f"{term}.{name}"]) for term, name in self._terms.memory]

    def _repeated(
        self, interval: Interval, given: Mapping[str, Tensor], values: Buffers
    ) -> Repeated | Abreast:
        """What makes frames of this length; most are as long as one of the last few was."""
        if interval not in self._ready:
            if len(self._ready) == LENGTHS:
                self._ready.clear()
            self._ready[interval] = self._made(interval, given, values)
        return self._ready[interval]

    def _made(self, interval: Interval, given: Mapping[str, Tensor], values: Buffers) -> Repeated | Abreast:
        terms, program = self._terms, self._program
        springs, abreast = terms.dynamics.system.edges.spring_count, self._abreast
        if abreast is not None and not self._meeting and pays(terms.count, springs, lanes_of(abreast)):
            return Abreast(abreast, terms, interval, given)
        whole = Buffers({**values.single, **self._meeting}, values.lists)
        return Repeated(program, interval, whole, terms.count, terms.dynamics.mass)

    def _places(self, points: Tensor) -> Tensor:
        """[*b, n, 3] as [B, n, 3], or as [1, n, 3] where the batch shares them."""
        flat = self._terms.flat(points.flatten(-2))
        return flat.reshape(len(flat), -1, 3)

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
