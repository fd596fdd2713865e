"""What every force term must keep, asked of all of them; and the seams a new one comes through."""

import pytest
import torch
from torch.autograd import gradcheck

from model.gap.effects import ALL_EFFECTS
from model.simulator.dynamics import Dynamics
from model.simulator.forces import ALL_FORCES
from model.simulator.forces.base import AxialForce, ForceTerm, arguments
from model.simulator.parameters import Constant
from model.simulator.simulator import Simulator
from model.simulator.system import Anchors, State

EFFECTS = {term.name: term for effect in ALL_EFFECTS for term in effect.terms if issubclass(term, ForceTerm)}
TERMS = tuple({**EFFECTS, **{kind.name: kind for kind in ALL_FORCES}}.values())
every_force = pytest.mark.parametrize("kind", TERMS, ids=lambda kind: kind.name)


@every_force
def test_documents_reference_and_units(kind):
    assert "Reference:" in kind.__doc__
    for name, constant in kind.constants.items():
        unit = constant.unit.replace("*", "·").replace("^2", "²")
        assert f"{name}: " in kind.__doc__
        assert f"[{unit}]" in kind.__doc__


@every_force
def test_internal_forces_have_no_net_force_and_no_torque(kind, make, force_of, free, state):
    if kind.internal:
        force = force_of(make(kind, free), free, state)
        size = force.norm(dim=1).sum()
        assert size > 1.0
        assert force.sum(0).norm() < 1e-12 * size
        torque = torch.linalg.cross(state.positions, force).sum(0).norm()
        assert (torque < 1e-12 * size) == kind.central


@every_force
def test_turns_with_the_world(kind, make, force_of, system, state, anchors, rotation, about_vertical):
    term = make(kind, system)
    if "height" in kind.constants:  # the ground turns about the vertical alone
        rotation = about_vertical
    turned = State(state.positions @ rotation.T, state.velocities @ rotation.T)
    held = Anchors(anchors.positions @ rotation.T, anchors.velocities @ rotation.T)
    before = force_of(term, system, state, anchors)
    if "gravity" in kind.constants:  # its direction is part of the world
        term = kind(term.value("gravity") @ rotation.T)
    if "x" in kind.constants:  # so is that of the wind, and of a weight
        x, y, z = rotation @ torch.stack([term.value(axis) for axis in "xyz"])
        term = term.with_values(x=x, y=y, z=z)
    after = force_of(term, system, turned, held)
    assert before.norm() > 0.1
    torch.testing.assert_close(after, before @ rotation.T, rtol=1e-10, atol=1e-12 * float(before.norm()))


@every_force
def test_is_minus_the_gradient_of_its_energy(kind, make, force_of, told, system, state, anchors):
    term = make(kind, system)
    place = state.positions.clone().requires_grad_()
    dynamics = Dynamics(system, [term], [])
    motion = dynamics.motion(State(place, state.velocities), anchors)
    energy = term.energy(motion, {**dynamics.forces[0][1], **told(term, dynamics, state, anchors)})
    if energy is None:
        remembers = issubclass(kind, AxialForce) and kind.memory
        assert kind.dissipative or remembers or "x" in kind.constants
        return
    (gradient,) = torch.autograd.grad(energy, place)
    torch.testing.assert_close(-gradient, force_of(term, system, state, anchors), rtol=1e-9, atol=1e-9)


@every_force
def test_takes_power_out_where_dissipative(kind, make, force_of, free, rng):
    if not kind.dissipative:
        return
    term = make(kind, free)
    for _ in range(20):
        state = State(
            free.points + torch.from_numpy(rng.normal(0, 0.02, free.points.shape)),
            torch.from_numpy(rng.normal(0, 1.0, free.points.shape)),
        )
        power = (force_of(term, free, state) * state.velocities).sum()
        assert power < 0


@every_force
def test_gradients_are_right(kind, make, told, system, state, anchors):
    term = make(kind, system)
    remembered = told(term, Dynamics(system, [term], []), state, anchors)
    names = [*kind.constants, *remembered]

    def force(place, speed, held, held_speed, mass, rest_length, *values):
        dynamics = Dynamics(system, [], [])
        dynamics.mass, dynamics.rest_length = mass.unsqueeze(-1), rest_length
        motion = dynamics.motion(State(place, speed), Anchors(held, held_speed))
        return term.force(motion, dict(zip(names, values, strict=True)))

    inputs = [state.positions, state.velocities, anchors.positions, anchors.velocities, system.value("mass")]
    inputs += [Dynamics(system, [], []).rest_length, *(term.value(name) for name in kind.constants)]
    inputs += remembered.values()
    inputs = [value.detach().clone().requires_grad_() for value in inputs]
    assert gradcheck(force, inputs, eps=1e-7, atol=1e-4, rtol=1e-5)


def test_scalar_law_agrees_with_the_mapped_force(force_of, system, make, state):
    """One spring by hand, from the scalar law alone."""
    kind = next(kind for kind in ALL_FORCES if kind.name == "spring")
    term = make(kind, system)
    assert arguments(kind.law) == ("length", "rest_length", "stiffness")
    by_hand = torch.zeros_like(state.positions)
    for (i, j), rest, k in zip(
        system.springs.tolist(), system.value("rest_length"), term.value("stiffness"), strict=True
    ):
        d = state.positions[j] - state.positions[i]
        pull = kind.law(length=d.norm(), rest_length=rest, stiffness=k) * d / d.norm()
        by_hand[i] += pull
        by_hand[j] -= pull
    held = Anchors(system.controller_points, torch.zeros_like(system.controller_points))
    torch.testing.assert_close(force_of(term, system, state, held), by_hand)


class Maxwell(AxialForce):
    """A spring in series with a dashpot: the law of a term that remembers, as an effect will bring it."""

    name = "maxwell"
    internal = central = True
    constants = {  # noqa: RUF012
        "stiffness": Constant("N/m", "springs", (1.0, 10.0)),
        "relaxation_rate": Constant("1/s", "springs", (0.1, 1.0)),
    }
    memory = {"viscous": 0.0}  # noqa: RUF012

    def __init__(self, stiffness, relaxation_rate):
        super().__init__(stiffness=stiffness, relaxation_rate=relaxation_rate)

    @staticmethod
    def law(length, rest_length, stiffness, relaxation_rate, viscous, dt):
        elastic = length - rest_length - viscous
        return stiffness * elastic, viscous + dt * relaxation_rate * elastic


def test_a_law_may_remember(free):
    """Held at a fixed stretch, the tension of a Maxwell element decays as exp(-rate t)."""
    simulator = Simulator(free, [Maxwell(stiffness=1e-6, relaxation_rate=2.0)])
    stretched = State(1.5 * free.points, torch.zeros_like(free.points))
    stretch = Dynamics(free, [], []).motion(stretched, None).length - free.value("rest_length")
    for substeps, error in ((50, 2e-2), (100, 1e-2)):
        end = simulator.rollout(stretched, frames=2, fps=2.0, substeps=substeps).end
        elastic = stretch - end.memory["maxwell.viscous"]
        decay = torch.exp(torch.tensor(-2.0 * 0.5, dtype=torch.float64))
        assert ((elastic / stretch - decay).abs() < error * decay).all()
        assert ((elastic / stretch - decay).abs() > 0.1 * error * decay).all()
