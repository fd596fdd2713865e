"""The fast path of a rollout: its terms as one compiled kernel."""

import math
from collections.abc import Mapping
from dataclasses import replace

import torch
from torch import Tensor

from model.simulator.contacts.ground import Ground
from model.simulator.dynamics import Dynamics
from model.simulator.forces.base import AxialForce
from model.simulator.forces.decay import Decay
from model.simulator.forces.gravity import Gravity
from model.simulator.forces.stencil import StencilForce
from model.simulator.integrators.base import Integrator
from model.simulator.integrators.semi_implicit_euler import SemiImplicitEuler
from model.simulator.kernel.build import CannotBuild, load
from model.simulator.kernel.call import Buffers, Interval
from model.simulator.kernel.corners import Corners, trace_corners
from model.simulator.kernel.emit import KINDS, TYPES, kernel_source
from model.simulator.kernel.expression import Untraceable
from model.simulator.kernel.function import NAMED, FrameFunction, Task
from model.simulator.kernel.groups import SYSTEM, Act, Group, Input, Kind, trace_group
from model.simulator.kernel.layout import lay_out, lay_out_stencils
from model.simulator.kernel.program import Acts, Program
from model.simulator.kernel.slopes import Slopes
from model.simulator.parameters import Values
from model.simulator.system import Anchors, State


class Inexpressible(Exception):
    """What cannot run in a kernel, in a few words that name the term."""


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
        _check(dynamics, integrator)
        self._batch, self._count = batch, math.prod(batch)
        edges = dynamics.system.edges
        groups = {kind: group for kind in KINDS if (group := _group(dynamics, kind)) is not None}
        stencils = [(t, v) for t, v in dynamics.forces if isinstance(t, StencilForce) and len(t.stencils)]
        corners = [_corners(term, values) for term, values in stencils]
        ground = next(((t, v) for t, v in dynamics.contacts if isinstance(t, Ground)), None)
        dtype = dynamics.mass.dtype
        try:
            library = load(kernel_source(groups, corners, ground is not None, dtype))
        except CannotBuild as error:
            raise Inexpressible(str(error)) from error
        inputs: list[tuple[Acts, Input]] = [(k, each) for k, group in groups.items() for each in group.inputs]
        inputs += [(number, each) for number, law in enumerate(corners) for each in law.inputs]
        self._memory = [name for group in groups.values() for name in group.memory]
        self._program = Program(
            library,
            lay_out(edges),
            lay_out_stencils(edges, tuple(term for term, _ in stencils)) if stencils else None,
            tuple(kind for kind, each in inputs if each.each),
            tuple(kind for kind, each in inputs if not each.each),
            tuple(kind for kind, group in groups.items() for _ in group.memory),
        )
        self._dynamics, self._ground = dynamics, {} if ground is None else ground[1]
        terms = {SYSTEM: {"rest_length": dynamics.rest_length}}
        terms |= {term.name: dict(values) for term, values in dynamics.forces}
        self._edges = [self._value(dynamics, terms, kind, each) for kind, each in inputs if each.each]
        self._scenes = [self._value(dynamics, terms, kind, each) for kind, each in inputs if not each.each]
        with torch.no_grad():
            kinds = self._program.edges
            self._packed = [self._program.spread(v, k) for v, k in zip(self._edges, kinds, strict=True)]
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
        start = [value.reshape(self._count, *shape[-2:]) for value in (state.positions, state.velocities)]
        none = state.positions.new_zeros(1, 0, 3)
        held = (none, none) if controls is None else tuple(self._flat(c.flatten(-2)) for c in controls)
        memories = [
            self._flat(state.memory[f"{term}.{name}"]).expand(self._count, -1) for term, name in self._memory
        ]
        given, values = self._at(interval.dt)
        task = Task(self._program, values, interval, keeps)
        ended = FrameFunction.apply(  # type: ignore[no-untyped-call]
            task,
            *(value.contiguous() for value in start),
            *(h.reshape(len(h), -1, 3).expand(self._count, -1, -1) for h in held),
            *(given[name] for name in NAMED[4:]),
            *self._edges,
            *self._scenes,
            *memories,
        )
        after = {
            f"{term}.{name}": value.reshape(*self._batch, -1)
            for (term, name), value in zip(self._memory, ended[2:], strict=True)
        }
        return replace(
            state, positions=ended[0].reshape(shape), velocities=ended[1].reshape(shape), memory=after
        )

    def slopes(self, state: State, anchors: Anchors | None) -> Slopes | None:
        """Products with the transposed Jacobian of the accelerations at a state [m, m/s], [*b, N, 3].

        None where a law remembers: what it does then depends on how long a step is.
        """
        if self._memory:
            return None
        flat = [value.reshape(self._count, -1, 3) for value in (state.positions, state.velocities)]
        if anchors is not None:
            held = [self._flat(a.flatten(-2)) for a in (anchors.positions, anchors.velocities)]
            anchors = Anchors(*(h.reshape(len(h), -1, 3) for h in held))
        _, values = self._at(1.0)
        return Slopes(self._program, values, State(flat[0], flat[1]), anchors)

    def _at(self, dt: float) -> tuple[dict[str, Tensor], Buffers]:
        """The values of points for substeps of `dt` [s], and all constants as the kernel reads them."""
        if dt not in self._timed:
            made = self._point_values(dt)
            self._timed[dt] = made, self._buffers(made)
        return self._timed[dt]

    def _flat(self, value: Tensor) -> Tensor:
        """[*b, n] as [B, n], or as [1, n] where the batch shares it."""
        if math.prod(value.shape[:-1]) == 1:
            return value.reshape(1, value.shape[-1])
        return value.expand(*self._batch, value.shape[-1]).reshape(self._count, value.shape[-1])

    def _point_values(self, dt: float) -> dict[str, Tensor]:
        """Gravity [B, 3], and what each point has one value of [B, N], for substeps of `dt` [s]."""
        dynamics = self._dynamics
        count, like = len(dynamics.system.points), dynamics.mass
        gravity, factor = like.new_zeros(3), like.new_ones(count, 1)
        for term, values in dynamics.forces:
            if isinstance(term, Gravity):
                gravity = values["gravity"]
            if isinstance(term, Decay):
                factor = factor * term.factor(values, dt)
        nothing = like.new_zeros(1)
        made = {"inverse_mass": dynamics.inverse_mass.squeeze(-1), "factor": factor.squeeze(-1)}
        for name in ("restitution", "friction", "height"):
            value = self._ground.get(name, nothing)
            made[name] = value if value.ndim else value.unsqueeze(-1)
        points = {name: self._flat(value.expand(*value.shape[:-1], count)) for name, value in made.items()}
        return {"gravity": self._flat(gravity), **points}

    def _value(self, dynamics: Dynamics, terms: Mapping[str, Values], kind: Acts, given: Input) -> Tensor:
        edges, value = dynamics.system.edges, terms[given.term][given.name]
        if not given.each:
            return self._flat(value.unsqueeze(-1) if not value.ndim else value)
        if not isinstance(kind, int) and value.shape[-1] == len(edges) and edges.controller_spring_count:
            start = 0 if kind == "springs" else edges.spring_count
            size = edges.spring_count if kind == "springs" else edges.controller_spring_count
            value = value.narrow(-1, start, size)
        return self._flat(value)

    def _buffers(self, given: Mapping[str, Tensor]) -> Buffers:
        point = self._program.layout.point
        single = {name: value.index_select(1, point) for name, value in given.items() if name != "gravity"}
        single["gravity"] = given["gravity"]
        if self._scenes:
            most = max(len(value) for value in self._scenes)
            single["scene"] = torch.cat([value.expand(most, -1) for value in self._scenes], -1)
        return Buffers(
            {name: value.detach().contiguous() for name, value in single.items()}, {"edge": self._packed}
        )


def _check(dynamics: Dynamics, integrator: Integrator) -> None:
    """Refuse what no kernel knows."""
    if type(integrator) is not SemiImplicitEuler:
        raise Inexpressible(f"the integrator {integrator.name!r} is not in it")
    if dynamics.mass.device.type != "cpu" or dynamics.mass.dtype not in TYPES:
        raise Inexpressible(f"it does not compute in {dynamics.mass.dtype} on {dynamics.mass.device.type}")
    for term, _ in dynamics.forces:
        plain = isinstance(term, AxialForce) and all(
            getattr(type(term), name) is getattr(AxialForce, name)
            for name in ("force", "edge_force", "tension")
        )
        plain |= isinstance(term, StencilForce) and type(term).force is StencilForce.force
        if not (plain or isinstance(term, Decay) or type(term) is Gravity):
            raise Inexpressible(f"the force {term.name!r} is not in it")
    for contact, _ in dynamics.contacts:
        if type(contact) is not Ground:
            raise Inexpressible(f"the contact {contact.name!r} is not in it")


def _group(dynamics: Dynamics, kind: Kind) -> Group | None:
    """What pulls the edges of a kind, traced; None where nothing does."""
    edges = dynamics.system.edges
    count = edges.spring_count if kind == "springs" else edges.controller_spring_count
    acts = []
    for term, values in dynamics.forces:
        if isinstance(term, AxialForce) and term.where in (kind, "edges"):
            size = count if term.where == kind else len(edges)
            each = tuple((name, _each(value, size, term.name, name)) for name, value in values.items())
            acts.append(Act(term.name, type(term), each))
    if not acts or not count:
        return None
    try:
        return trace_group(tuple(acts))
    except Untraceable as error:
        raise Inexpressible(str(error)) from error


def _corners(term: StencilForce, values: Values) -> Corners:
    """What acts on small groups of points, traced."""
    size = len(term.stencils)
    each = tuple((name, _each(value, size, term.name, name)) for name, value in values.items())
    try:
        return trace_corners(type(term), each)
    except Untraceable as error:
        raise Inexpressible(str(error)) from error


def _each(value: Tensor, size: int, term: str, name: str) -> bool:
    """Whether a constant has one value per edge or stencil."""
    if value.shape[-1:] in ((), (1,)):
        return False
    if value.shape[-1] != size:
        raise Inexpressible(f"{name} of {term!r} is not one value per edge or stencil")
    return True
