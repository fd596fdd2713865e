"""What a diagnosis compares: the plain twin, and the plain twin with effects."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from model.gap.effects.base import Effect, Field, Quantity
from model.gap.plain import PlainTwin
from model.gap.world import World


@dataclass(frozen=True)
class Hypothesis:
    """A plain twin with effects, as a function of all their quantities.

    A quantity of an effect is called `effect.quantity`, one of the twin by its own name.
    """

    twin: PlainTwin
    effects: tuple[Effect, ...] = ()
    held: Mapping[str, float] | None = None
    """Quantities that are not free, and their values."""
    where: Field | None = None
    """Where the effects act; None: on all alike."""
    believing: bool = True
    """What is believed of its quantities beforehand counts; a ceiling asks what could be, however unusual."""

    @property
    def quantities(self) -> dict[str, Quantity]:
        """Those that are free."""
        own = {
            f"{effect.name}.{name}": quantity
            for effect in self.effects
            for name, quantity in effect.quantities.items()
        }
        held = self.held or {}
        free = {name: q for name, q in {**self.twin.quantities, **own}.items() if name not in held}
        return free if self.believing else {name: replace(q, spread=None) for name, q in free.items()}

    @property
    def of_effects(self) -> tuple[str, ...]:
        """Names of the quantities of its effects, free or not."""
        return tuple(f"{effect.name}.{name}" for effect in self.effects for name in effect.quantities)

    @property
    def together(self) -> bool:
        """Many of its worlds can be rolled out at once."""
        return all(effect.together for effect in self.effects)

    def with_effect(self, effect: Effect) -> "Hypothesis":
        """One effect more."""
        return replace(self, effects=(*self.effects, effect))

    def holding(self, values: Mapping[str, float]) -> "Hypothesis":
        """Some quantities at fixed values."""
        return replace(self, held={**(self.held or {}), **values})

    def __call__(self, values: Mapping[str, Tensor]) -> World:
        """The world of values, each a scalar or of shape [b, 1]."""
        like = next(iter(values.values()))
        fixed = {name: torch.full_like(like, value) for name, value in (self.held or {}).items()}
        known = {**fixed, **values}
        own = {name: known[name] for name in self.twin.quantities}
        plain = world = self.twin.world(own)
        for effect in self.effects:
            strength = {name: known[f"{effect.name}.{name}"] for name in effect.quantities}
            world = effect.apply(world, strength, self.where)
        return self.twin.eased(plain, world, own)(world) if self.effects else plain

    def at(self, values: Mapping[str, float]) -> World:
        """The one world of these values."""
        return self({name: torch.tensor(value, dtype=torch.float64) for name, value in values.items()})
