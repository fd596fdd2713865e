"""The fast path of a rollout on a CUDA device: its terms as kernels of one thread per point."""

import ctypes
from collections.abc import Mapping
from dataclasses import replace

import torch
from torch import Tensor

from model.simulator.dynamics import Dynamics
from model.simulator.integrators.base import Integrator
from model.simulator.kernel.build import CannotBuild
from model.simulator.kernel.call import Interval
from model.simulator.kernel.cuda.emit import TYPES, kernel_source
from model.simulator.kernel.cuda.frame import Values, frame_type
from model.simulator.kernel.cuda.function import FrameFunction, Task
from model.simulator.kernel.cuda.layout import lay_out, lay_out_stencils
from model.simulator.kernel.cuda.module import MOST, WIDEST, Loader, load
from model.simulator.kernel.cuda.program import Program
from model.simulator.kernel.cuda.slopes import Slopes
from model.simulator.kernel.function import NAMED
from model.simulator.kernel.terms import Inexpressible, Terms
from model.simulator.system import Anchors, State


class CudaKernel:
    """All terms of a dynamics, compiled for the device that its tensors are on.

    Args:
        dynamics: The terms and their constants.
        integrator: How time advances.
        batch: Leading dimensions of the states that will come.
        loader: What makes kernels of CUDA text.

    Raises:
        Inexpressible: a term or the integrator that no kernel knows, or no NVRTC; says which.
    """

    def __init__(
        self, dynamics: Dynamics, integrator: Integrator, batch: torch.Size, loader: Loader = load
    ) -> None:
        """See the class."""
        dtype, device, edges = dynamics.mass.dtype, dynamics.mass.device, dynamics.system.edges
        if dtype not in TYPES:
            raise Inexpressible(f"it does not compute in {dtype} on {device.type}")
        self._terms = terms = Terms(dynamics, integrator, batch)
        sizes = len(terms.edges), len(terms.scenes), len(terms.memory), len(terms.stencils)
        if ctypes.sizeof(frame_type(*sizes)) > MOST or terms.count > WIDEST:
            raise Inexpressible("one launch cannot hold so many terms, or so large a batch")
        try:
            module = loader(kernel_source(terms.groups, terms.corners, terms.ground, dtype), device)
        except CannotBuild as error:
            raise Inexpressible(str(error)) from error
        self._program = Program(
            module,
            lay_out(edges, device),
            lay_out_stencils(edges, terms.stencils, device) if terms.stencils else None,
            terms.edge_acts,
            terms.scene_acts,
            terms.memory_kinds,
        )
        with torch.no_grad():
            self._packed: dict[str, list[Tensor]] = {
                "edge": [
                    self._program.spread(value, kind)
                    for value, kind in zip(terms.edges, terms.edge_acts, strict=True)
                ],
                "scene": [value.contiguous() for value in terms.scenes],
            }
        self._timed = dict[float, tuple[Mapping[str, Tensor], Values]]()

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
        terms, shape = self._terms, state.positions.shape
        start = [value.reshape(terms.count, *shape[-2:]) for value in (state.positions, state.velocities)]
        none = state.positions.new_zeros(1, 0, 3)
        held = (none, none) if controls is None else tuple(self._places(c) for c in controls)
        memories = [
            terms.flat(state.memory[f"{term}.{name}"]).expand(terms.count, -1) for term, name in terms.memory
        ]
        given, values = self._at(interval.dt)
        ended = FrameFunction.apply(  # type: ignore[no-untyped-call]
            Task(self._program, values, interval, keeps),
            *start,
            *held,
            *(given[name] for name in NAMED[4:]),
            *terms.edges,
            *terms.scenes,
            *memories,
        )
        after = {
            f"{term}.{name}": value.reshape(*terms.batch, -1)
            for (term, name), value in zip(terms.memory, ended[2:], strict=True)
        }
        return replace(
            state, positions=ended[0].reshape(shape), velocities=ended[1].reshape(shape), memory=after
        )

    def slopes(self, state: State, anchors: Anchors | None) -> Slopes | None:
        """Products with the transposed Jacobian of the accelerations at a state [m, m/s], [*b, N, 3].

        None where a law remembers: its pull may depend on how long a step is, or on what is not at hand here.
        """
        if self._terms.memory:
            return None
        flat = [value.reshape(self._terms.count, -1, 3) for value in (state.positions, state.velocities)]
        if anchors is not None:
            anchors = Anchors(self._places(anchors.positions), self._places(anchors.velocities))
        _, values = self._at(1.0)
        return Slopes(self._program, values, State(flat[0], flat[1]), anchors)

    def _places(self, value: Tensor) -> Tensor:
        """[*b, C, 3] as [B, C, 3], or as [1, C, 3] where the batch shares it."""
        flat = self._terms.flat(value.flatten(-2))
        return flat.reshape(len(flat), -1, 3)

    def _at(self, dt: float) -> tuple[Mapping[str, Tensor], Values]:
        """The values of points for substeps of `dt` [s], and all constants as the kernel reads them."""
        if dt not in self._timed:
            given = self._terms.point_values(dt)
            point = self._program.layout.point
            with torch.no_grad():
                own = {
                    name: value.index_select(1, point) for name, value in given.items() if name != "gravity"
                }
                values: Values = {**own, **self._packed, "gravity": given["gravity"].detach().contiguous()}
            self._timed[dt] = given, values
        return self._timed[dt]
