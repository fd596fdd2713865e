"""Put scenes of different size into one system."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor

from model.errors import InputError
from model.simulator.batch import Joined, side_by_side
from model.simulator.contacts.base import ContactTerm
from model.simulator.contacts.ground import Ground
from model.simulator.forces.base import AxialForce, ForceTerm
from model.simulator.forces.gravity import Gravity
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.weight import Weight
from model.simulator.parameters import Over, Parametric
from model.simulator.simulator import Simulator
from model.simulator.system import System

NOWHERE = -1e30
"""Height [m] of the ground of a scene that has none."""


def join(simulators: Sequence[Simulator]) -> Joined:
    """Put scenes side by side: points, springs and controllers one after another, nothing between them.

    A constant becomes one value per point, edge or stencil where scenes differ or gradients are wanted: each
    scene keeps its own stiffness, drag, gravity, ground, and so on, and gradients reach each scene's own.

    Raises:
        InputError: no scene; scenes of different data types or integrators; a term that one scene has and
            another has not (the ground, and terms that act on nothing there, excepted); a term that cannot be
            joined. Says which.
    """
    if not simulators:
        raise InputError("there is no scene to join: give at least one simulator")
    first = simulators[0]
    if len({sim.system.points.dtype for sim in simulators}) > 1:
        raise InputError("scenes that are joined must compute in one data type")
    if len({type(sim.integrator) for sim in simulators}) > 1:
        raise InputError("scenes that are joined must have one integrator")
    system = _join_systems([sim.system for sim in simulators])
    forces = [_join_force(name, simulators, system) for name in _names([list(s.forces) for s in simulators])]
    contacts = [_join_ground(name, simulators) for name in _names([list(s.contacts) for s in simulators])]
    together = Simulator(system, forces, contacts, first.integrator, first.backend)
    return Joined(together, tuple(simulators))


def _join_systems(systems: Sequence[System]) -> System:
    points = np.cumsum([0, *(len(s.points) for s in systems)])
    controllers = np.cumsum([0, *(s.controller_count for s in systems)])
    edges = [s.edges for s in systems]
    held = []
    for edge, point, controller in zip(edges, points, controllers, strict=False):
        own = slice(edge.spring_count, None)
        held.append(
            torch.stack([edge.second[own] - edge.point_count + controller, edge.first[own] + point], 1)
        )
    rest = [s.controller_points for s in systems if s.controller_count]
    known = [r for r in rest if r is not None]
    values = {name: _constant(name, systems, systems) for name in System.constants}
    return System(
        points=torch.cat([s.points for s in systems]),
        springs=torch.cat([s.springs + int(point) for s, point in zip(systems, points, strict=False)]),
        controller_springs=torch.cat(held),
        controller_points=torch.cat(known) if known and len(known) == len(rest) else None,
        **values,
    )


def _join_force(name: str, simulators: Sequence[Simulator], system: System) -> ForceTerm:
    """One force of all scenes."""
    systems = [sim.system for sim in simulators]
    terms = _terms(name, [{n: sim.force(n) for n in sim.forces} for sim in simulators], systems)
    known = next(term for term in terms if term is not None)
    assert isinstance(known, ForceTerm)
    if isinstance(known, Gravity):
        return _join_gravity([t for t in terms if isinstance(t, Gravity)], systems)
    present = [(term, own) for term, own in zip(terms, systems, strict=True) if term is not None]
    values = {key: _constant(key, *map(list, zip(*present, strict=True))) for key in known.constants}
    made = known.with_values(**values)
    if isinstance(made, StencilForce):
        begins = np.cumsum([0, *(len(s.points) for s in systems)])
        moved = [
            term.stencils + int(begin)
            for term, begin in zip(terms, begins, strict=False)
            if isinstance(term, StencilForce)
        ]
        made._buffers = {**made._buffers, "stencils": torch.cat(moved)}
    return made


def _join_gravity(terms: Sequence[Gravity], systems: Sequence[System]) -> ForceTerm:
    """Gravity where all scenes have the same, known one; else the weight of every point."""
    pulls = [term.value("gravity") for term in terms]
    if not any(p.requires_grad for p in pulls) and all(torch.equal(p, pulls[0]) for p in pulls):
        return terms[0]
    weights = [
        pull.unsqueeze(-2) * _each(system, "mass", system).unsqueeze(-1)
        for pull, system in zip(pulls, systems, strict=True)
    ]
    x, y, z = side_by_side(weights, -2).unbind(-1)
    made = Weight(torch.arange(sum(len(s.points) for s in systems))[:, None], x, y, z)
    return made


def _join_ground(name: str, simulators: Sequence[Simulator]) -> ContactTerm:
    """One ground, at its own height for each scene; far below one that has none."""
    found = [sim.contact(name) if name in sim.contacts else None for sim in simulators]
    if any(term is not None and type(term) is not Ground for term in found):
        raise InputError(f"the contact {name!r} cannot be joined: roll such scenes out one by one")
    terms = [Ground(0.0, 0.0, NOWHERE) if term is None else term for term in found]
    systems = [sim.system for sim in simulators]
    return Ground(**{key: _constant(key, terms, systems) for key in Ground.constants})


def _names(each: Sequence[Sequence[str]]) -> list[str]:
    """All names, in the order in which they come up."""
    return list(dict.fromkeys(name for names in each for name in names))


def _terms(
    name: str, each: Sequence[Mapping[str, ForceTerm]], systems: Sequence[System]
) -> list[ForceTerm | None]:
    """The term of that name in every scene; None where it has nothing to act on."""
    known = next(terms[name] for terms in each if name in terms)
    found: list[ForceTerm | None] = []
    for number, (terms, system) in enumerate(zip(each, systems, strict=True)):
        term = terms.get(name)
        idle = isinstance(known, StencilForce) or (isinstance(known, AxialForce) and not _acts(known, system))
        if term is None and not idle:
            raise InputError(
                f"scene {number} has no {name!r}, which others have: add it with a value of zero"
            )
        if term is not None and type(term) is not type(known):
            raise InputError(f"{name!r} is not the same law in scene {number}: such scenes cannot be joined")
        found.append(term)
    return found


def _acts(term: AxialForce, system: System) -> int:
    return len(system.edges) if term.where == "edges" else system.size(term.where) or 0


def _constant(name: str, terms: Sequence[Parametric], systems: Sequence[System]) -> Tensor:
    """A constant of all scenes: one value where they agree and none is sought, else one for each element."""
    over = terms[0].constants[name].over
    values = [term.value(name) for term in terms]
    alone = all(value.shape in ((), (1,)) and not value.requires_grad for value in values)
    if alone and all(float(value.detach()) == float(values[0].detach()) for value in values):
        return values[0].detach().reshape(())
    each = [_each(term, name, system) for term, system in zip(terms, systems, strict=True)]
    if _over(terms[0], over) != "edges":
        return side_by_side(each, -1)
    springs = [value[..., : s.edges.spring_count] for value, s in zip(each, systems, strict=True)]
    held = [value[..., s.edges.spring_count :] for value, s in zip(each, systems, strict=True)]
    return side_by_side([*springs, *held], -1)


def _each(term: Parametric, name: str, system: System) -> Tensor:
    """One value for each element that a constant is about."""
    over = _over(term, term.constants[name].over)
    size = term.own_size(over) if over == "stencils" else system.size(over)
    if size is None:
        raise InputError(
            f"{name} of {type(term).__name__} is one number for all: such scenes cannot be joined"
        )
    value = term.value(name)
    return value.expand(*value.shape[:-1], size)


def _over(term: Parametric, over: Over) -> Over:
    """What a constant has to have one value for, so that scenes may differ."""
    if over != "scene":
        return over
    if isinstance(term, StencilForce):
        return "stencils"
    return term.where if isinstance(term, AxialForce) else "scene"
