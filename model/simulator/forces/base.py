"""A force term: a law, and where it acts."""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, ClassVar, TypeAlias

import torch
from jaxtyping import Float
from torch import Tensor

from model.simulator.motion import Motion, Where
from model.simulator.parameters import Parametric, Values

Scalar: TypeAlias = Any
"""What a law computes with: a number, a tensor, or what else answers to arithmetic and torch functions."""
Law: TypeAlias = Callable[..., Any]


class ForceTerm(Parametric, ABC):
    """A law over springs, points or small stencils, and where it acts.

    A subclass names its constants (`Parametric.constants`), writes its law as a static function of a few
    numbers, and says below which physics it keeps; the property tests hold it to that.
    """

    name: ClassVar[str]
    internal: ClassVar[bool] = False
    """The net force on the free points is zero (controllers and the world outside are not free points)."""
    central: ClassVar[bool] = False
    """So is the net torque."""
    dissipative: ClassVar[bool] = False
    """Its power is never positive."""
    steady: ClassVar[bool] = False
    """It pulls at points that do not move, from outside and alike wherever they are, as gravity does."""
    memory: ClassVar[Mapping[str, float]] = {}
    """What each edge or stencil that it acts on remembers, and its value before anything has happened."""

    @abstractmethod
    def force(self, motion: Motion, values: Values) -> Float[Tensor, "*b N 3"]:
        """Force [N] on every point; `values` are the constants as `Parametric.values` gives them."""

    def energy(self, motion: Motion, values: Values) -> Float[Tensor, "*b"] | None:
        """Potential [J] whose negative gradient the force is; None where there is none."""
        return None


class PairForce(ForceTerm, ABC):
    """Equal and opposite forces on the two ends of edges."""

    where: ClassVar[Where] = "springs"

    @abstractmethod
    def edge_force(self, motion: Motion, values: Values) -> Float[Tensor, "*b e 3"]:
        """Force [N] on the first end of each edge of `where`; the second feels the opposite."""

    def force(self, motion: Motion, values: Values) -> Float[Tensor, "*b N 3"]:
        """Force [N] on every point."""
        return motion.pull(spread(motion, self.where, self.edge_force(motion, values)))


class AxialForce(PairForce, ABC):
    """A tension along each edge, from a scalar law.

    `law` is a static function. It asks for what it needs by name: `length` [m], `rate` [m/s] (how fast the
    edge lengthens), `rest_length` [m], the term's constants, its `memory` and `dt` [s]; it uses arithmetic
    and torch functions only. It returns the tension [N], positive when the edge pulls; a law with memory
    returns a tuple: the tension, then the new value of each variable of `memory` in order.
    """

    law: ClassVar[Law]
    potential: ClassVar[Law | None] = None
    """Energy [J] of one edge, from the same names; -d/d length of it is minus the tension."""
    settled: ClassVar[Law | None] = None
    """What an edge remembers that has long been as long as it is, a tuple in the order of `memory`, from the
    same names; None: nothing has happened to it either."""

    def tension(
        self, motion: Motion, values: Values, memory: Values, dt: float
    ) -> tuple[Float[Tensor, "*b e"], dict[str, Tensor]]:
        """Tension [N] of each edge of `where`, and what each remembers after `dt` [s]."""
        result = self._evaluate(type(self).law, motion, {**values, **memory}, dt)
        if not self.memory:
            return result, {}
        return result[0], dict(zip(self.memory, result[1:], strict=True))

    def rest_memory(
        self, length: Float[Tensor, "*b e"], rest_length: Float[Tensor, "*r e"], values: Values
    ) -> dict[str, Tensor]:
        """What edges remember that have long been so long [m]."""
        settled = type(self).settled
        if settled is None:
            return self._fresh(length)
        known = {**values, "length": length, "rest_length": rest_length}
        return dict(zip(self.memory, _asked(settled, known.__getitem__), strict=True))

    def rest_tension(
        self, length: Float[Tensor, "*b e"], rest_length: Float[Tensor, "*r e"], values: Values
    ) -> Float[Tensor, "*b e"]:
        """Tension [N] of edges that have long been so long [m]."""
        known = {**values, **self.rest_memory(length, rest_length, values)}
        known |= {"length": length, "rest_length": rest_length, "rate": torch.zeros_like(length)}
        known["dt"] = torch.zeros_like(length)
        found = _asked(type(self).law, known.__getitem__)
        tension: Tensor = found[0] if self.memory else found
        return tension

    def edge_force(self, motion: Motion, values: Values) -> Float[Tensor, "*b e 3"]:
        """The tension along the axis, of an edge that remembers nothing yet."""
        fresh = self._fresh(motion.over(motion.length, self.where))
        tension, _ = self.tension(motion, values, fresh, 0.0)
        return tension.unsqueeze(-1) * motion.over(motion.axis, self.where, dim=-2)

    def energy(self, motion: Motion, values: Values) -> Float[Tensor, "*b"] | None:
        """Sum of `potential` over the edges [J]."""
        potential = type(self).potential
        if potential is None:
            return None
        energies: Tensor = self._evaluate(potential, motion, values, 0.0)
        return energies.sum(-1)

    def _fresh(self, like: Tensor) -> dict[str, Tensor]:
        return {name: torch.full_like(like, value) for name, value in self.memory.items()}

    def _evaluate(self, law: Law, motion: Motion, known: Values, dt: float) -> Scalar:
        def look_up(name: str) -> Scalar:
            if name in known:
                return known[name]
            return dt if name == "dt" else motion.over(getattr(motion, name), self.where)

        return _asked(law, look_up)


def _asked(law: Law, look_up: Callable[[str], Scalar]) -> Scalar:
    """What a law says of what it asks for."""
    return law(**{name: look_up(name) for name in arguments(law)})


@cache
def arguments(law: Law) -> tuple[str, ...]:
    """The names a law asks for."""
    return tuple(inspect.signature(law).parameters)


def spread(motion: Motion, where: Where, forces: Float[Tensor, "*b k 3"]) -> Float[Tensor, "*b e 3"]:
    """Forces on the edges of `where` as forces on all edges, zero elsewhere."""
    if where == "edges":
        return forces
    springs, controllers = (forces, None) if where == "springs" else (None, forces)
    joined = motion.join(springs, controllers, motion.displacement, dim=-2)
    assert joined is not None
    return joined
