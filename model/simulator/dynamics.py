"""All terms of a simulator, with their constants evaluated once, ready for many steps."""

from collections.abc import Sequence
from copy import copy

import torch
from jaxtyping import Float
from torch import Tensor

from model.simulator.contacts.base import ContactTerm
from model.simulator.forces.base import AxialForce, ForceTerm, PairForce, spread
from model.simulator.forces.decay import Decay
from model.simulator.forces.stencil import StencilForce
from model.simulator.motion import Motion
from model.simulator.parameters import Values, broadcast
from model.simulator.system import Anchors, State, System


class Dynamics:
    """What an integrator asks: accelerations, decay and contacts of a state.

    Made at the start of a rollout: every constant is computed once, with its graph, and shared by all steps.
    """

    def __init__(self, system: System, forces: Sequence[ForceTerm], contacts: Sequence[ContactTerm]) -> None:
        """Evaluate the constants of `system`, `forces` and `contacts`."""
        self.system = system
        constants = system.values(system.points)
        self.mass = constants["mass"].expand(*constants["mass"].shape[:-1], len(system.points)).unsqueeze(-1)
        self.inverse_mass = 1.0 / self.mass
        self.rest_length = _joined(system, constants)
        self.forces = [(term, term.values(system.points)) for term in forces]
        self.contacts = [(term, term.values(system.points)) for term in contacts]
        self._axial = [(t, v) for t, v in self.forces if isinstance(t, AxialForce) and self._acts(t)]
        self._pair = [
            (t, v)
            for t, v in self.forces
            if isinstance(t, PairForce) and not isinstance(t, AxialForce) and self._acts(t)
        ]
        self._other = [(t, v) for t, v in self.forces if not isinstance(t, PairForce | Decay) and _meets(t)]
        self._decay = [(t, v) for t, v in self.forces if isinstance(t, Decay)]
        self._factors: dict[float, Tensor] = {}

    def without(self, contact: ContactTerm) -> "Dynamics":
        """The same, evaluated once as it is, but for one contact."""
        rest = copy(self)
        rest.contacts = [(term, values) for term, values in self.contacts if term is not contact]
        return rest

    @property
    def batch(self) -> torch.Size:
        """The leading dimensions that the constants have in common."""
        shapes = [self.mass.shape[:-2], self.rest_length.shape[:-1]]
        for _, values in [*self.forces, *self.contacts]:
            shapes += [value.shape[:-1] for value in values.values()]
        return broadcast(*shapes)

    def motion(self, state: State, anchors: Anchors | None) -> Motion:
        """What the laws see of `state`, with the controllers at `anchors`."""
        held = anchors if self.system.controller_count else None
        return Motion(self.system.edges, state, held, self.mass, self.rest_length)

    def acceleration(
        self, state: State, anchors: Anchors | None, dt: float
    ) -> tuple[Float[Tensor, "*b N 3"], dict[str, Tensor]]:
        """Acceleration [m/s²] of every point, and what laws with memory remember after `dt` [s]."""
        motion = self.motion(state, anchors)
        memory: dict[str, Tensor] = {}
        pulls = self._pulls(motion, state, dt, memory)
        force = None if pulls is None else motion.pull(pulls)
        for term, values in self._other:
            known = recalled(term, values, state)
            if isinstance(term, StencilForce):
                memory |= _named(term, term.remembered(motion, known, dt))
            more = term.force(motion, known)
            force = more if force is None else force + more
        if force is None:
            return torch.zeros_like(state.positions), memory
        return force * self.inverse_mass, memory

    def decay(self, velocities: Float[Tensor, "*b N 3"], dt: float) -> Float[Tensor, "*b N 3"]:
        """Velocities [m/s] after the exactly solvable forces have acted for `dt` [s]."""
        factor = self._factors.get(dt)
        if factor is None:
            for term, values in self._decay:
                more = term.factor(values, dt)
                factor = more if factor is None else factor * more
            if factor is None:
                return velocities
            if not factor.requires_grad:  # a checkpoint that runs again must store what it stored before
                self._factors[dt] = factor
        return velocities * factor

    def collide(
        self, positions: Float[Tensor, "*b N 3"], velocities: Float[Tensor, "*b N 3"], dt: float
    ) -> Float[Tensor, "*b N 3"]:
        """Velocities [m/s] after the contacts of a step of `dt` [s]."""
        for term, values in self.contacts:
            velocities = term.resolve(positions, velocities, self.mass, dt, values)
        return velocities

    def rest_memory(self, state: State, anchors: Anchors | None) -> dict[str, Tensor]:
        """What laws with memory remember of edges and stencils that have long been as they are."""
        motion = self.motion(state, anchors)
        remembered: dict[str, Tensor] = {}
        for term, values in self._axial:
            if term.memory:
                length, rest = (motion.over(each, term.where) for each in (motion.length, motion.rest_length))
                remembered |= _named(term, term.rest_memory(length, rest, values))
        for other, values in self._other:
            if isinstance(other, StencilForce):
                remembered |= _named(other, other.rest_memory(motion, values))
        return remembered

    def _acts(self, term: PairForce) -> bool:
        edges = self.system.edges
        return len(edges) > 0 if term.where == "edges" else bool(self.system.size(term.where))

    def _pulls(self, motion: Motion, state: State, dt: float, memory: dict[str, Tensor]) -> Tensor | None:
        """The force [N] of all pair laws on the first end of each edge."""
        sums: dict[str, Tensor] = {}
        for term, values in self._axial:
            remembered = _of(term, state.memory) if term.memory else {}
            tension, after = term.tension(motion, values, remembered, dt)
            memory |= _named(term, after)
            sums[term.where] = sums[term.where] + tension if term.where in sums else tension
        total = sums.get("edges")
        joined = motion.join(sums.get("springs"), sums.get("controllers"), motion.length) if sums else None
        if joined is not None:
            total = joined if total is None else total + joined
        pulls = None if total is None else total.unsqueeze(-1) * motion.axis
        for pair, values in self._pair:
            more = spread(motion, pair.where, pair.edge_force(motion, values))
            pulls = more if pulls is None else pulls + more
        return pulls


def recalled(term: ForceTerm, values: Values, state: State) -> Values:
    """Constants of a term, and what its stencils remember, if it has any."""
    return {**values, **_of(term, state.memory)} if isinstance(term, StencilForce) else values


def _meets(term: ForceTerm) -> bool:
    return not isinstance(term, StencilForce) or len(term.stencils) > 0


def _named(term: ForceTerm, memory: Values) -> dict[str, Tensor]:
    return {f"{term.name}.{name}": value for name, value in memory.items()}


def _of(term: ForceTerm, memory: Values) -> dict[str, Tensor]:
    return {name: memory[f"{term.name}.{name}"] for name in term.memory}


def _joined(system: System, constants: Values) -> Tensor:
    """Rest lengths of springs and controller springs, one per edge."""
    springs, held = constants["rest_length"], constants["controller_rest_length"]
    springs = springs.expand(*springs.shape[:-1], system.edges.spring_count)
    if not system.edges.controller_spring_count:
        return springs
    held = held.expand(*held.shape[:-1], system.edges.controller_spring_count)
    batch = broadcast(springs.shape[:-1], held.shape[:-1])
    return torch.cat([springs.expand(*batch, springs.shape[-1]), held.expand(*batch, held.shape[-1])], -1)
