"""Forces on small groups of points: bending of three in a row, the volume of four."""

from abc import ABC
from typing import ClassVar

import torch
from jaxtyping import Float, Int
from torch import Tensor

from model.errors import InputError
from model.simulator.forces.base import ForceTerm, Law, Scalar, arguments
from model.simulator.forces.vectors import Vector
from model.simulator.motion import Motion
from model.simulator.parameters import TensorLike, Values


class StencilForce(ForceTerm, ABC):
    """Forces that follow from an energy of the places of a few points, or that a law gives outright.

    A subclass says how many points a stencil has, and either `potential` or `law`, as a static function that
    asks for what it needs by name: `positions` [m] and `velocities` [m/s] (tuples of as many `Vector`s as the
    stencil has points) and the term's constants; it uses arithmetic and torch functions only. `potential`
    gives the energy [J] of a stencil, and the forces are its negative gradient. `law` gives the force [N] on
    each point, as a tuple of `Vector`s. What a stencil remembers, by the names of `memory`, is a constant to
    both; `after` says what it is at the end of a step.

    Args:
        stencils: Indices of the points, shape [stencil_count, size].
        values: The declared constants; those over `stencils` have one value for all or one for each.

    Raises:
        InputError: indices of the wrong shape, or a stencil with the same point twice.
    """

    size: ClassVar[int]
    """Points in a stencil."""
    potential: ClassVar[Law | None] = None
    law: ClassVar[Law | None] = None
    after: ClassVar[Law | None] = None
    """What a stencil with memory remembers after `dt` [s], a tuple in the order of `memory`, from the same
    names."""
    settled: ClassVar[Law | None] = None
    """The same of one that has long been where it is; None: nothing has happened to it either."""
    stencils: Tensor

    def __init__(self, stencils: Int[Tensor, "..."], **values: TensorLike) -> None:
        """See the class."""
        super().__init__(**values)
        if stencils.ndim != 2 or stencils.shape[1] != self.size:
            raise InputError(
                f"stencils of {self.name} have shape {list(stencils.shape)}: give [count, {self.size}] points"
            )
        in_order = stencils.sort(dim=1).values
        if bool((in_order[:, 1:] == in_order[:, :-1]).any()):
            raise InputError(f"stencils of {self.name} hold a point twice: give {self.size} different points")
        self.register_buffer("stencils", stencils.long(), persistent=False)

    def own_size(self, over: str) -> int | None:
        """How many values a constant over `stencils` has."""
        return len(self.stencils) if over == "stencils" else super().own_size(over)

    def remembered(self, motion: Motion, values: Values, dt: float) -> dict[str, Tensor]:
        """What each stencil remembers after `dt` [s]; `values` are constants and what it remembers now."""
        after = type(self).after
        if not self.memory or after is None:
            return {}
        places, speeds = self._gather(motion.positions), self._gather(motion.velocities)
        found = _ask(after, {**values, "dt": torch.as_tensor(dt, dtype=places.dtype)}, places, speeds)
        return dict(zip(self.memory, found, strict=True))

    def rest_memory(self, motion: Motion, values: Values) -> dict[str, Tensor]:
        """What stencils remember that have long been where they are."""
        if not self.memory:
            return {}
        places, settled = self._gather(motion.positions), type(self).settled
        if settled is None:
            like = places[..., 0, 0]
            return {name: torch.full_like(like, value) for name, value in self.memory.items()}
        found = _ask(settled, values, places, torch.zeros_like(places))
        return dict(zip(self.memory, found, strict=True))

    def force(self, motion: Motion, values: Values) -> Float[Tensor, "*b N 3"]:
        """Force [N] on every point; `values` are constants and what stencils remember."""
        places, speeds = self._gather(motion.positions), self._gather(motion.velocities)
        law = type(self).law
        if law is not None:
            forces = _ask(law, values, places, speeds)
            return self._scatter(motion, torch.stack([torch.stack(force, -1) for force in forces], -2))
        differentiable = [places, speeds, *values.values()]
        wanted = torch.is_grad_enabled() and any(value.requires_grad for value in differentiable)
        with torch.enable_grad():
            if not places.requires_grad:
                places = places.detach().requires_grad_()
            energy = self._energies(values, places, speeds).sum()
            (slope,) = torch.autograd.grad(energy, places, create_graph=wanted)
        slope = slope if wanted else slope.detach()
        return self._scatter(motion, -slope)

    def energy(self, motion: Motion, values: Values) -> Float[Tensor, "*b"] | None:
        """Sum of `potential` over the stencils [J], of the same; None where there is none."""
        if type(self).potential is None:
            return None
        places, speeds = self._gather(motion.positions), self._gather(motion.velocities)
        return self._energies(values, places, speeds).sum(-1)

    def _energies(self, values: Values, places: Tensor, speeds: Tensor) -> Tensor:
        potential = type(self).potential
        assert potential is not None
        energies: Tensor = _ask(potential, values, places, speeds)
        return energies

    def _gather(self, values: Float[Tensor, "*b N 3"]) -> Float[Tensor, "*b S n 3"]:
        gathered = values.index_select(-2, self.stencils.reshape(-1))
        return gathered.reshape(*values.shape[:-2], *self.stencils.shape, 3)

    def _scatter(self, motion: Motion, forces: Float[Tensor, "*b S n 3"]) -> Float[Tensor, "*b N 3"]:
        """The sum on each point of the forces on the corners."""
        total = torch.zeros_like(motion.positions).expand(*forces.shape[:-3], *motion.positions.shape[-2:])
        return total.index_add(-2, self.stencils.reshape(-1), forces.flatten(-3, -2))


def _ask(law: Law, values: Values, places: Tensor, speeds: Tensor) -> Scalar:
    """What a law says of every stencil at once."""
    known = {"positions": vectors(places), "velocities": vectors(speeds), **values}
    return law(**{name: known[name] for name in arguments(law)})


def vectors(points: Float[Tensor, "*b n 3"]) -> tuple[Vector, ...]:
    """The points as a law sees them."""
    return tuple(tuple(point.unbind(-1)) for point in points.unbind(-2))
