"""Many worlds side by side move as each of them does alone."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from model.gap.effects.viscoelasticity import MaxwellBranch
from model.simulator.contacts.ground import Ground
from model.simulator.forces.bending import Bending
from model.simulator.forces.bending_damping import BendingDamping
from model.simulator.forces.curved_bending import CurvedBending
from model.simulator.forces.gravity import Gravity
from model.simulator.kernel import abreast, emit, kernel
from model.simulator.kernel.abreast import Abreast, pays
from model.simulator.kernel.call import Interval
from model.simulator.kernel.kernel import Kernel
from model.simulator.kernel.program import Repeated
from model.simulator.kernel.threads import kernel_threads
from model.simulator.system import State

WORLDS, SPRINGS = 19, 260
"""A full group of eight or sixteen, and one that is not full."""
EXACT = {torch.float64: 1e-12, torch.float32: 2e-5}


def rolled(made, backend, **options):
    """Without gradients, which many worlds side by side have none of."""
    with torch.no_grad():
        simulator = made.simulator.with_backend(backend)
        return simulator.rollout(made.state(), made.controls, fps=50.0, substeps=40, **options)


@pytest.fixture
def worlds(scene):
    """Scenes of nineteen worlds, each with springs, dashpots and bends of its own."""

    def build(dtype=torch.float64, **options):
        rng = np.random.default_rng(2)
        corners = torch.from_numpy(np.stack([rng.permutation(61)[:3] for _ in range(19)]))
        stiffness = torch.tensor(rng.uniform(1e-6, 1e-5, (WORLDS, 19)), dtype=dtype)
        turn = torch.tensor(rng.uniform(0.1, 0.5, (WORLDS, 19)), dtype=dtype)
        return scene(
            dtype, forces=[CurvedBending(corners, stiffness, 0.05, turn)], batch=(WORLDS,), **options
        )

    return build


@pytest.mark.parametrize("dtype", EXACT)
def test_they_move_as_the_oracle_says(worlds, apart, dtype):
    expected, found = (rolled(worlds(dtype), backend) for backend in ("torch", "kernel"))
    assert float(expected.points[..., 2].min()) < 1e-3, "nothing touched the ground"
    assert apart(expected.points[:, 0], expected.points[:, 1]) > 1e-4, "all worlds are alike"
    assert apart(found.points, expected.points) < EXACT[dtype]
    assert apart(found.velocities, expected.velocities) < 10 * EXACT[dtype]


@pytest.mark.parametrize("dtype", EXACT)
@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_stencils_of_any_number_bend_and_damp(scene, apart, count, dtype):
    rng = np.random.default_rng(3)
    corners = torch.from_numpy(np.stack([rng.permutation(61)[:3] for _ in range(count)]))
    span = torch.tensor(rng.uniform(0.04, 0.06, (WORLDS, 1)), dtype=dtype)
    stiffness = torch.tensor(rng.uniform(1e-6, 1e-5, (WORLDS, count)), dtype=dtype)
    damping = torch.tensor(rng.uniform(1e-6, 1e-5, (WORLDS, count)), dtype=dtype)
    forces = [Bending(corners, stiffness, span), BendingDamping(corners, damping, span)]
    bare, made = scene(dtype, batch=(WORLDS,)), scene(dtype, forces=forces, batch=(WORLDS,))
    expected, found = (rolled(made, backend) for backend in ("torch", "kernel"))
    assert apart(rolled(bare, "torch").points, expected.points) > 10 * EXACT[dtype], "none does anything"
    assert apart(found.points, expected.points) < EXACT[dtype]
    assert apart(found.velocities, expected.velocities) < 10 * EXACT[dtype]


def test_each_meets_a_ground_of_its_own(worlds, apart):
    made = worlds()
    rng = np.random.default_rng(6)
    law = {"restitution": (0.0, 0.8), "friction": (0.0, 0.9), "height": (-0.01, 0.005)}
    ground = Ground(**{name: torch.tensor(rng.uniform(*span, (WORLDS, 1))) for name, span in law.items()})
    made = replace(made, simulator=made.simulator.with_contact(ground))
    runs = [rolled(made, backend) for backend in ("torch", "kernel")]
    lowest = runs[0].points[..., 2].amin((0, 2))
    assert len(lowest.unique()) == WORLDS, "all grounds are alike"
    assert apart(runs[1].points, runs[0].points) < 1e-12


def test_each_has_its_own_gravity_hands_and_start(worlds, apart):
    made = worlds()
    generator = torch.Generator().manual_seed(0)
    gravity = torch.rand((WORLDS, 3), generator=generator, dtype=torch.float64) * 20.0 - 10.0
    simulator = made.simulator.with_force(Gravity(gravity))
    shift = 0.01 * torch.rand((WORLDS, 1, 3), generator=generator, dtype=torch.float64)
    controls = made.controls.detach().unsqueeze(1) + shift
    start = State(made.leaves["positions"].detach() + shift, made.leaves["velocities"].detach() + shift)
    runs = []
    with torch.no_grad():
        for backend in ("torch", "kernel"):
            runs.append(simulator.with_backend(backend).rollout(start, controls, fps=50.0, substeps=40))
    assert apart(runs[1].points, runs[0].points) < 1e-12


def test_they_remember_each_for_itself(worlds, apart):
    made = worlds()
    rng = np.random.default_rng(4)
    stiffness = torch.tensor(rng.uniform(10.0, 80.0, (WORLDS, 260)))
    late = torch.tensor(rng.uniform(0.01, 0.1, (WORLDS, 1)))
    half = torch.full((260,), 0.5, dtype=torch.float64)
    branch = MaxwellBranch(stiffness, half, torch.tensor(2.0), late)
    simulator = made.simulator.with_force(branch)
    with torch.no_grad():
        runs = [
            simulator.with_backend(backend).rollout(made.state(), made.controls, fps=50.0, substeps=40)
            for backend in ("torch", "kernel")
        ]
    assert apart(runs[1].points, runs[0].points) < 1e-12
    for name, memory in runs[0].end.memory.items():
        assert apart(runs[1].end.memory[name], memory) < 1e-10, name
    assert runs[0].end.memory, "nothing is remembered"


def test_a_few_are_run_one_after_the_other(worlds, apart, monkeypatch):
    made = worlds()
    side_by_side = rolled(made, "kernel")
    monkeypatch.setattr(kernel, "pays", lambda worlds, springs, lanes: False)
    one_by_one = rolled(made, "kernel")
    assert not torch.equal(one_by_one.points, side_by_side.points), "the same sums in the same order"
    assert apart(side_by_side.points, one_by_one.points) < 1e-12


@pytest.mark.parametrize(("beside", "kind"), [(True, Abreast), (False, Repeated)])
def test_what_is_lost_in_one_stays_in_it(worlds, monkeypatch, beside, kind):
    monkeypatch.setattr(kernel, "pays", lambda worlds, springs, lanes: beside)
    made = worlds()
    with torch.no_grad():
        dynamics = made.simulator.dynamics()
        runner = Kernel(dynamics, made.simulator.integrator, torch.Size([WORLDS]))
        start = made.state()
        places = start.positions.expand(WORLDS, -1, -1).clone()
        speeds = start.velocities.expand(WORLDS, -1, -1).clone()
        controls = made.controls[0], made.controls[1]
        interval = Interval(dt=0.0005, count=40, seconds=0.02)
        memory = dynamics.rest_memory(State(places, speeds), None)
        sound = runner.advance(State(places, speeds, memory), controls, interval, False)
        speeds[3, 7] = torch.nan
        lost = runner.advance(State(places, speeds, memory), controls, interval, False)
    assert [type(ready) for ready in runner._ready.values()] == [kind]
    others = [world for world in range(WORLDS) if world != 3]
    assert torch.equal(lost.positions[others], sound.positions[others])
    assert not torch.isfinite(lost.positions[3]).all()


def test_frames_of_many_lengths_take_turns(worlds, apart):
    made = worlds()
    controls = made.controls.detach()[[0, 1, 2, 3, 2, 1, 0, 1, 2, 3]]
    times = np.cumsum([0.0, 0.02, 0.021, 0.02, 0.022, 0.019, 0.023, 0.024, 0.02, 0.021])
    with torch.no_grad():
        runs = [
            made.simulator.with_backend(backend).rollout(made.state(), controls, times=times, substeps=40)
            for backend in ("torch", "kernel")
        ]
    assert apart(runs[1].points, runs[0].points) < 1e-11


def test_threads_change_nothing(worlds):
    made = worlds()
    runs = []
    for threads in (1, 2, 3):
        with kernel_threads(threads):
            runs.append(rolled(made, "kernel").points)
    assert torch.equal(runs[0], runs[1])
    assert torch.equal(runs[0], runs[2])


def test_how_many_are_abreast_changes_nothing(worlds, monkeypatch):
    runs = []
    for lanes in (8, 16):
        monkeypatch.setitem(emit.LANES, True, [f"#define LANES {lanes}"])
        runs.append(rolled(worlds(), "kernel").points)
    assert torch.equal(*runs)


@pytest.mark.parametrize(
    ("lanes", "worlds", "few", "many"),
    [
        (8, 1, False, False),
        (8, 4, False, False),
        (8, 5, True, False),
        (8, 6, True, True),
        (8, 9, True, False),
        (8, 12, True, True),
        (16, 4, False, False),
        (16, 5, True, False),
        (16, 9, True, True),
        (16, 17, True, False),
        (16, 18, True, True),
    ],
)
def test_lanes_without_a_world_of_their_own_do_not_pay(lanes, worlds, few, many):
    assert pays(worlds, 700, lanes) == few
    assert pays(worlds, 20_000, lanes) == many


@pytest.mark.parametrize(("fewest", "kind"), [(SPRINGS, Abreast), (SPRINGS - 1, Repeated)])
def test_how_many_pay_is_asked_of_the_graph_that_is_run(worlds, monkeypatch, fewest, kind):
    monkeypatch.setattr(abreast, "FEW", fewest)
    monkeypatch.setattr(abreast, "FULL", {8: (0.3, 2.0), 16: (0.3, 2.0)})
    made = worlds()
    with torch.no_grad():
        dynamics = made.simulator.dynamics()
        runner = Kernel(dynamics, made.simulator.integrator, torch.Size([WORLDS]))
        start = made.state()
        whole = State(*(value.expand(WORLDS, -1, -1) for value in (start.positions, start.velocities)))
        remembering = replace(whole, memory=dynamics.rest_memory(whole, None))
        interval = Interval(dt=0.0005, count=4, seconds=0.002)
        runner.advance(remembering, (made.controls[0], made.controls[1]), interval, False)
    assert [type(ready) for ready in runner._ready.values()] == [kind]
