"""The terms of a rollout as a kernel sees them: their traced laws, and their constants."""

import math
from collections.abc import Mapping

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
from model.simulator.kernel.corners import Corners, trace_corners
from model.simulator.kernel.expression import Untraceable
from model.simulator.kernel.groups import KINDS, SYSTEM, Act, Acts, Group, Input, Kind, trace_group
from model.simulator.parameters import Values


class Inexpressible(Exception):
    """What cannot run in a kernel, in a few words that name the term."""


class Terms:
    """All terms of a dynamics, traced; constants are tensors [B, n], or [1, n] where the batch shares them.

    Args:
        dynamics: The terms and their constants.
        integrator: How time advances.
        batch: Leading dimensions of the states that will come.

    Raises:
        Inexpressible: a term or the integrator that no kernel knows; says which.
    """

    def __init__(self, dynamics: Dynamics, integrator: Integrator, batch: torch.Size) -> None:
        """See the class."""
        _check(dynamics, integrator)
        self.dynamics, self.batch, self.count = dynamics, batch, math.prod(batch)
        self.groups = {kind: group for kind in KINDS if (group := _group(dynamics, kind)) is not None}
        stencils = [(t, v) for t, v in dynamics.forces if isinstance(t, StencilForce) and len(t.stencils)]
        self.stencils = tuple(term for term, _ in stencils)
        self.corners = [_corners(term, values) for term, values in stencils]
        ground = next((v for t, v in dynamics.contacts if isinstance(t, Ground)), None)
        self.ground, self._ground = ground is not None, ground or {}
        inputs: list[tuple[Acts, Input]] = [
            (kind, each) for kind, group in self.groups.items() for each in group.inputs
        ]
        inputs += [(number, each) for number, law in enumerate(self.corners) for each in law.inputs]
        self.edge_acts = tuple(kind for kind, each in inputs if each.each)
        """What each constant with one value per edge or stencil belongs to."""
        self.scene_acts = tuple(kind for kind, each in inputs if not each.each)
        """The same for the constants of the scene."""
        kept: list[tuple[Acts, Group | Corners]] = [*self.groups.items(), *enumerate(self.corners)]
        self.memory = [name for _, each in kept for name in each.memory]
        """Term and variable of all that is remembered."""
        self.memory_kinds = tuple(kind for kind, each in kept for _ in each.memory)
        known = {SYSTEM: {"rest_length": dynamics.rest_length}}
        known |= {term.name: dict(values) for term, values in dynamics.forces}
        self.edges = [self._value(known, kind, each) for kind, each in inputs if each.each]
        self.scenes = [self._value(known, kind, each) for kind, each in inputs if not each.each]

    def flat(self, value: Tensor) -> Tensor:
        """[*b, n] as [B, n], or as [1, n] where the batch shares it."""
        if math.prod(value.shape[:-1]) == 1:
            return value.reshape(1, value.shape[-1])
        return value.expand(*self.batch, value.shape[-1]).reshape(self.count, value.shape[-1])

    def point_values(self, dt: float) -> dict[str, Tensor]:
        """Gravity [B, 3], and what each point has one value of [B, N], for substeps of `dt` [s]."""
        dynamics = self.dynamics
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
        points = {name: self.flat(value.expand(*value.shape[:-1], count)) for name, value in made.items()}
        return {"gravity": self.flat(gravity), **points}

    def _value(self, known: Mapping[str, Values], kind: Acts, given: Input) -> Tensor:
        edges, value = self.dynamics.system.edges, known[given.term][given.name]
        if not given.each:
            return self.flat(value.unsqueeze(-1) if not value.ndim else value)
        if not isinstance(kind, int) and value.shape[-1] == len(edges) and edges.controller_spring_count:
            start = 0 if kind == "springs" else edges.spring_count
            size = edges.spring_count if kind == "springs" else edges.controller_spring_count
            value = value.narrow(-1, start, size)
        return self.flat(value)


def _check(dynamics: Dynamics, integrator: Integrator) -> None:
    """Refuse what no kernel knows."""
    if type(integrator) is not SemiImplicitEuler:
        raise Inexpressible(f"the integrator {integrator.name!r} is not in it")
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
