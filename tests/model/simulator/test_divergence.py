import pytest
import torch

from model.errors import InputError
from model.simulator.divergence import SimulationDiverged
from model.simulator.forces.drag import Drag
from model.simulator.forces.gravity import Gravity
from model.simulator.forces.spring import Spring
from model.simulator.simulator import Simulator
from model.simulator.system import State, System

pytestmark = pytest.mark.usefixtures("backend")


def test_says_frame_point_and_term(free, state):
    """A spring so stiff that it explodes; the drag and the gravity beside it are not to blame."""
    simulator = Simulator(free, [Gravity(), Spring(1e30), Drag(1.0)])
    with (
        pytest.warns(UserWarning, match="stability needs"),
        pytest.raises(SimulationDiverged, match="use more than 20 substeps per frame") as caught,
    ):
        simulator.rollout(state, frames=20, substeps=20)
    assert isinstance(caught.value, InputError)
    assert caught.value.frame == 1
    assert caught.value.term == "spring"
    assert 0 <= caught.value.point < len(free.points)
    assert "\n" not in str(caught.value)


def test_names_the_frame_it_really_happened_in(free, state):
    """Growth by a known factor per step: the frame where float64 overflows is not the first."""
    simulator = Simulator(free, [Spring(1e6)])
    with pytest.warns(UserWarning, match="stability needs"), pytest.raises(SimulationDiverged) as caught:
        simulator.rollout(state, frames=400, substeps=4)
    frame = caught.value.frame
    assert frame > 2
    with pytest.warns(UserWarning, match="stability needs"):
        before = simulator.rollout(state, frames=frame, substeps=4)
    assert torch.isfinite(before.points).all()


def test_blames_the_strongest_force_where_all_are_finite():
    """A force that is a number, on a mass so small that the acceleration is none."""
    system = System(
        points=torch.tensor([[0.0, 0, 0], [2.0, 0, 0]], dtype=torch.float64),
        mass=0.01,
        springs=torch.tensor([[0, 1]]),
        rest_length=1.0,
    )
    for forces in ([Gravity(), Spring(1e307)], [Spring(1e307), Gravity()]):
        with pytest.raises(SimulationDiverged) as caught:
            Simulator(system, forces).rollout(frames=2, substeps=20)
        assert caught.value.term == "spring"


def test_blames_the_point_that_started_it(free):
    speeds = torch.zeros_like(free.points)
    speeds[4, 1] = float("inf")
    with pytest.raises(SimulationDiverged) as caught:
        Simulator(free, [Gravity()]).rollout(State(free.points, speeds), frames=2)
    assert caught.value.point == 4
