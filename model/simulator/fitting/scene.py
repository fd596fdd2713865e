"""What a fit rolls out: a simulator, when the frames are, where it starts and what holds it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from model.errors import InputError
from model.simulator.contacts.base import ContactTerm
from model.simulator.forces.base import ForceTerm
from model.simulator.parameters import Constant, Parametric
from model.simulator.simulator import Rollout, Simulator
from model.simulator.system import State

_FREE = {
    "state.positions": Constant("m", "points", (-10.0, 10.0), positive=False),
    "state.velocities": Constant("m/s", "points", (-10.0, 10.0), positive=False),
    "controls.offset": Constant("m", "controllers", (-0.1, 0.1), positive=False),
}
"""What may be fitted beside the constants of terms."""


@dataclass(frozen=True)
class Scene:
    """An interaction, ready to be rolled out."""

    simulator: Simulator
    times: Float[np.ndarray, " T"]
    """Of each frame [s]."""
    controls: Float[Tensor, "T *b C 3"] | None = None
    """Where the controllers are in each frame [m]; None: they rest."""
    state: State | None = None
    """Of frame 0; None: at rest."""

    def rollout(
        self, frames: int | None = None, *, substeps: int | None = None, checkpoint: bool = False
    ) -> Rollout:
        """The first `frames` frames; None: all of them. See `Simulator.rollout`."""
        controls = None if self.controls is None else self.controls[:frames]
        return self.simulator.rollout(
            self.state, controls, times=self.times[:frames], substeps=substeps, checkpoint=checkpoint
        )

    def constant(self, name: str) -> Constant:
        """What is known of the parameter `name`: see `with_values`.

        Raises:
            InputError: there is none of that name; says which there are.
        """
        if name in _FREE:
            return _FREE[name]
        owner, _, own = name.partition(".")
        module = self._modules().get(owner)
        if module is None or own not in module.constants:
            known = [f"{key}.{each}" for key, module in self._modules().items() for each in module.constants]
            raise InputError(f"the scene has no parameter {name!r}: it has {', '.join([*known, *_FREE])}")
        return module.constants[own]

    def value(self, name: str) -> Tensor:
        """The parameter `name` as it is, in its unit; see `with_values`."""
        self.constant(name)
        owner, _, own = name.partition(".")
        if owner == "state":
            state = self.state or self.simulator.rest_state()
            return state.positions if own == "positions" else state.velocities
        if owner == "controls":
            return torch.zeros(3, dtype=torch.float64)
        return self._modules()[owner].value(own)

    def with_values(self, values: Mapping[str, Tensor]) -> "Scene":
        """The scene with other values of some parameters.

        Args:
            values: By name: `term.constant` of any force or contact, added ones included (`spring.stiffness`,
                `ground.friction`), `system.mass` and the other constants of the system, `state.positions`
                and `state.velocities` of frame 0 (any shape that broadcasts to [N, 3]), and
                `controls.offset`, which is added to where the controllers are (to [C, 3]).

        Raises:
            InputError: a parameter that there is not, or a value that does not fit.
        """
        state, controls = self.state or self.simulator.rest_state(), self.controls
        changed: dict[str, dict[str, Tensor]] = {}
        for name, value in values.items():
            self.constant(name)
            owner, _, own = name.partition(".")
            if owner == "state":
                whole = value.to(state.positions).expand_as(state.positions)
                places, speeds = state.positions, state.velocities
                state = State(*((whole, speeds) if own == "positions" else (places, whole)), state.memory)
            elif owner == "controls":
                controls = self._motion() + value.to(self.simulator.system.points)
            else:
                changed.setdefault(owner, {})[own] = value
        return replace(self, simulator=self._simulator(changed), state=state, controls=controls)

    def _simulator(self, changed: Mapping[str, Mapping[str, Tensor]]) -> Simulator:
        if not changed:
            return self.simulator
        made = {name: module.with_values(**changed.get(name, {})) for name, module in self._modules().items()}
        forces = [term for term in made.values() if isinstance(term, ForceTerm)]
        contacts = [term for term in made.values() if isinstance(term, ContactTerm)]
        system = self.simulator.system.with_values(**changed.get("system", {}))
        return Simulator(system, forces, contacts, self.simulator.integrator, self.simulator.backend)

    def _modules(self) -> dict[str, Parametric]:
        """Everything with constants, by name: the system, then forces and contacts in their order."""
        own = self.simulator
        forces = {name: own.force(name) for name in own.forces}
        return {"system": own.system, **forces, **{name: own.contact(name) for name in own.contacts}}

    def _motion(self) -> Tensor:
        """Where the controllers are in each frame."""
        if self.controls is not None:
            return self.controls
        held = self.simulator.system.controller_points
        if held is None or not self.simulator.system.controller_count:
            raise InputError("controls.offset has nothing to move: give the controls of the scene")
        return held.expand(len(self.times), *held.shape)
