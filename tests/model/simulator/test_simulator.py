import numpy as np
import pytest
import torch
from torch.autograd import gradcheck
from torch.func import functional_call

from model.errors import InputError
from model.simulator.contacts.ground import Ground
from model.simulator.forces.controller import ControllerSpring
from model.simulator.forces.dashpot import Dashpot
from model.simulator.forces.drag import Drag
from model.simulator.forces.gravity import Gravity
from model.simulator.forces.spring import Spring
from model.simulator.simulator import Simulator
from model.simulator.system import Anchors, State, System

pytestmark = pytest.mark.usefixtures("backend")


@pytest.fixture
def forces(system):
    k = torch.linspace(50, 200, system.size("springs"), dtype=torch.float64)
    return [Spring(k), ControllerSpring(300.0), Dashpot(0.5), Gravity(), Drag(0.8)]


@pytest.fixture
def simulator(system, forces):
    return Simulator(system, forces, [Ground(0.2, 0.05, 0.0)])


@pytest.fixture
def controls(system):
    time = torch.arange(4, dtype=torch.float64)[:, None, None]
    return system.controller_points + 0.01 * time * torch.tensor([1.0, -0.5, 2.0])


def test_frame_zero_is_the_rest_state_and_frames_have_times(simulator, controls):
    rollout = simulator.rollout(controls=controls, fps=25.0)
    torch.testing.assert_close(rollout.points[0], simulator.system.points)
    assert rollout.points.shape == rollout.velocities.shape == (4, 9, 3)
    assert rollout.times.tolist() == pytest.approx([0, 0.04, 0.08, 0.12])
    assert len(rollout.substeps) == 3
    torch.testing.assert_close(rollout.end.positions, rollout.points[-1])


def test_a_rollout_is_its_steps(simulator, controls):
    """Controllers sit at the end of each substep, with the velocity of their motion between the frames."""
    rollout = simulator.rollout(controls=controls[:2], fps=100.0, substeps=10)
    state, velocity = simulator.rest_state(), (controls[1] - controls[0]) * 100.0
    for number in range(1, 11):
        anchors = Anchors(controls[0] + (controls[1] - controls[0]) * number / 10, velocity)
        state = simulator.step(state, anchors, 0.01 / 10)
    torch.testing.assert_close(rollout.points[-1], state.positions, rtol=1e-12, atol=1e-14)


def test_a_rollout_goes_on_from_its_end(simulator, controls):
    whole = simulator.rollout(controls=controls, fps=300.0, substeps=5)
    half = simulator.rollout(controls=controls[:3], fps=300.0, substeps=5)
    rest = simulator.rollout(half.end, controls=controls[2:], fps=300.0, substeps=5)
    torch.testing.assert_close(rest.points[-1], whole.points[-1], rtol=1e-12, atol=1e-14)


def test_times_need_not_be_even(simulator, controls):
    uneven = simulator.rollout(controls=controls[:3], times=[0.0, 0.02, 0.1])
    assert uneven.substeps[1] == pytest.approx(4 * uneven.substeps[0], abs=4)
    again = simulator.rollout(controls=controls[:2], times=np.array([0.0, 0.02]))
    assert torch.equal(uneven.points[1], again.points[1])


@pytest.mark.parametrize("clock", [{"fps": 1e13}, {"times": [0.0, 0.02, 0.02 + 2e-13, 0.1]}])
def test_frames_too_close_to_be_told_apart_are_refused(simulator, controls, clock):
    with pytest.raises(InputError, match=r"frame . comes (1|2)e-13 s after the one before, too soon"):
        simulator.rollout(controls=controls, **clock)


def test_without_controls_the_controllers_stay(simulator, system):
    held = simulator.rollout(frames=3, fps=300.0)
    given = simulator.rollout(controls=system.controller_points.expand(3, -1, -1), fps=300.0)
    assert torch.equal(held.points, given.points)
    assert not torch.equal(held.points[-1], held.points[0])


def test_checkpoints_change_no_gradient(simulator, controls):
    stiffness = simulator.force("spring").log_stiffness.requires_grad_(True)
    friction = simulator.contact("ground").log_friction.requires_grad_(True)
    gradients, values = [], []
    for checkpoint in (False, True):
        place = controls.clone().requires_grad_()
        rollout = simulator.rollout(controls=place, checkpoint=checkpoint, fps=300.0, substeps=5)
        values.append(rollout.points.detach())
        gradients.append(torch.autograd.grad((rollout.points**2).sum(), (stiffness, friction, place)))
    assert torch.equal(*values)
    for plain, checkpointed in zip(*gradients, strict=True):
        assert plain.abs().max() > 0
        torch.testing.assert_close(plain, checkpointed, rtol=1e-12, atol=1e-18)


def test_gradients_reach_every_parameter(system, controls):
    """A rollout of a few steps with sliding contact, away from kinks, against finite differences."""
    names = [
        "stiffness",
        "held_stiffness",
        "damping",
        "drag",
        "gravity",
        "restitution",
        "friction",
        "mass",
        "rest",
    ]

    def last(
        stiffness, held, damping, drag, gravity, restitution, friction, mass, rest, place, speed, motion
    ):
        own = System(
            points=system.points, mass=mass, springs=system.springs, rest_length=rest,
            controller_springs=torch.tensor([[0, 2], [1, 5], [1, 6]]), controller_rest_length=0.03,
        )  # fmt: skip
        forces = [Spring(stiffness), ControllerSpring(held), Dashpot(damping), Drag(drag), Gravity(gravity)]
        made = Simulator(own, forces, [Ground(restitution, friction, -0.05)])
        return made.rollout(State(place, speed), motion, fps=200.0, substeps=3).points[-1]

    scalars = [0.5, 0.8]
    inputs = [
        torch.full((system.size("springs"),), 100.0), torch.full((3,), 200.0), *map(torch.tensor, scalars),
        torch.tensor([0.1, 0.2, -9.81]), torch.tensor(0.3), torch.tensor(0.1), system.value("mass"),
        system.value("rest_length"), system.points,
        torch.tensor([1.0, 0.5, -0.8]).expand(9, 3) + 0.1 * system.points, controls[:2],
    ]  # fmt: skip
    inputs = [value.detach().to(torch.float64).clone().requires_grad_() for value in inputs]
    gradients = torch.autograd.grad((last(*inputs) ** 2).sum(), inputs)
    for name, gradient in zip([*names, "place", "speed", "motion"], gradients, strict=True):
        assert gradient.abs().max() > 0, name
    assert gradcheck(last, inputs, eps=1e-6, atol=1e-7, fast_mode=True)


def test_functional_call_replaces_parameters(simulator, controls):
    weak = functional_call(
        simulator,
        {"forces.spring.log_stiffness": torch.zeros(simulator.system.size("springs"))},
        (None, controls),
        {"fps": 300.0},
    )
    strong = simulator.rollout(controls=controls, fps=300.0)
    assert (weak.points[-1] - strong.points[-1]).abs().max() > 1e-4


def test_with_force_makes_a_new_one(simulator, controls):
    before = simulator.rollout(controls=controls, fps=300.0).points
    stronger = simulator.with_force(Gravity((0.0, 0.0, -20.0)))
    assert stronger is not simulator
    assert list(stronger.forces) == list(simulator.forces)
    assert stronger.force("spring") is simulator.force("spring")
    assert not torch.equal(stronger.rollout(controls=controls, fps=300.0).points, before)
    assert torch.equal(simulator.rollout(controls=controls, fps=300.0).points, before)
    raised = simulator.with_contact(Ground(0.2, 0.4, 0.05))
    assert len(raised.contacts) == 1
    assert not torch.equal(raised.rollout(controls=controls, fps=300.0).points, before)


def test_batches_are_many_rollouts(system, forces, controls):
    """Two parameter sets on one scene, in one go."""
    sets = [(40.0, 0.1, (0.0, 0.0, -9.81), 0.2), (160.0, 0.7, (1.0, 0.0, -5.0), 0.9)]

    def build(stiffness, damping, gravity, friction):
        terms = [Spring(stiffness), ControllerSpring(300.0), Dashpot(damping), Gravity(gravity), Drag(0.8)]
        return Simulator(system, terms, [Ground(0.2, friction, 0.0)])

    stacked = [torch.tensor(values, dtype=torch.float64) for values in zip(*sets, strict=True)]
    together = build(*(value if value.ndim > 1 else value[:, None] for value in stacked))
    both = together.rollout(controls=controls, fps=300.0, substeps=5).points
    assert both.shape == (4, 2, 9, 3)
    for number, values in enumerate(sets):
        alone = build(*values).rollout(controls=controls, fps=300.0, substeps=5).points
        torch.testing.assert_close(both[:, number], alone, rtol=1e-10, atol=1e-12)


def test_float32_follows_float64(simulator, controls):
    wide = simulator.rollout(controls=controls, fps=300.0)
    narrow = simulator.float().rollout(controls=controls, fps=300.0)
    assert narrow.points.dtype == torch.float32
    torch.testing.assert_close(narrow.points.double(), wide.points, rtol=0, atol=1e-5)


def test_same_input_same_bytes(simulator, controls):
    assert torch.equal(
        simulator.rollout(controls=controls, fps=300.0).points,
        simulator.rollout(controls=controls, fps=300.0).points,
    )


def test_progress_is_told_every_frame(simulator, controls):
    seen = []
    simulator.rollout(controls=controls, fps=300.0, progress=lambda done, total: seen.append((done, total)))
    assert seen == [(1, 3), (2, 3), (3, 3)]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "how long to roll out is not said"),
        ({"frames": 0}, "0 frames at 30.0 per second"),
        ({"frames": 3, "fps": 0.0}, "3 frames at 0.0 per second"),
        ({"frames": 2, "times": [0.0, 0.1, 0.2]}, "3 times for 2 frames"),
        ({"times": [0.0, 0.2, 0.1]}, "strictly increasing"),
        ({"frames": 3, "substeps": 0}, "substeps is 0"),
        (
            {"controls": torch.zeros(3, 5, 3)},
            r"controls have shape \[3, 5, 3\]: the controllers need \[3, 2, 3\]",
        ),
        ({"controls": torch.full((3, 2, 3), float("nan"))}, "controls are not finite"),
        (
            {"state": State(torch.zeros(4, 3), torch.zeros(4, 3)), "frames": 2},
            "the state has 4 points, the system 9",
        ),
    ],
)
def test_bad_input_is_refused(simulator, given, message):
    with pytest.raises(InputError, match=message):
        simulator.rollout(**given)


def test_two_terms_of_a_name_are_refused(system):
    with pytest.raises(InputError, match="same name: spring, spring"):
        Simulator(system, [Spring(1.0), Spring(2.0)])


def test_a_checkpoint_is_recomputed_with_drag_that_is_sought(system, controls):
    rate = torch.tensor(0.8, dtype=torch.float64, requires_grad=True)
    simulator = Simulator(system, [Spring(40.0), Drag(rate)], backend="torch")
    slopes = []
    for checkpoint in (False, True):
        rollout = simulator.rollout(controls=controls, fps=300.0, substeps=5, checkpoint=checkpoint)
        slopes += torch.autograd.grad(rollout.points.square().sum(), rate)
    assert float(slopes[0]) == pytest.approx(float(slopes[1]), rel=1e-12)
    assert float(slopes[0]) != 0
