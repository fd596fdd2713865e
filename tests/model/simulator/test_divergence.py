import pytest
import torch

from model.errors import InputError
from model.gap.effects.plastic_bending import PlasticBending
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


def test_blames_a_law_by_what_it_remembers(free, state):
    """It is at ease in the first frame, and far too stiff for any other."""
    rows = torch.tensor([[0, 1, 2], [3, 4, 5]])
    stiff = PlasticBending(rows, bending_stiffness=1e307, span=0.05, yield_turn=1e3, flow_rate=0.0)
    with pytest.raises(SimulationDiverged) as caught:
        Simulator(free, [Gravity(), Spring(50.0), stiff]).rollout(state, frames=20, substeps=20)
    assert caught.value.term == "plastic_bending"


def test_blames_the_point_that_started_it(free):
    speeds = torch.zeros_like(free.points)
    speeds[4, 1] = float("inf")
    with pytest.raises(SimulationDiverged) as caught:
        Simulator(free, [Gravity()]).rollout(State(free.points, speeds), frames=2)
    assert caught.value.point == 4


def softer_and_softer(free, stiffness):
    """Worlds of one graph, each of another stiffness [b]."""
    return Simulator(free, [Gravity(), Spring(torch.tensor(stiffness, dtype=torch.float64)[:, None])])


def test_of_a_lossy_batch_only_those_that_diverge_are_lost(free, state):
    stiffness = [50.0, 1e30, 80.0, 1e6]
    rollout = softer_and_softer(free, stiffness).rollout(
        state, frames=300, substeps=20, trusted=True, lossy=True
    )
    lost = torch.isnan(rollout.points)
    assert lost[1:, 1].all()
    assert lost[-1, 3].all()
    assert not lost[1, 3].any()
    for one in (0, 2):
        alone = Simulator(free, [Gravity(), Spring(stiffness[one])]).rollout(
            state, frames=100, substeps=20, trusted=True
        )
        # Roundings, which some processors make otherwise in a batch, double every third of a second.
        torch.testing.assert_close(rollout.points[:100, one], alone.points)
        assert not lost[:, one].any()


def test_a_lossy_rollout_goes_on_when_all_is_lost_and_computes_nothing(free, state):
    seen = []
    rollout = Simulator(free, [Gravity(), Spring(1e30)]).rollout(
        state,
        frames=6,
        substeps=20,
        trusted=True,
        lossy=True,
        lead=lambda frame, now: (seen.append(frame), now)[1],
    )
    assert seen == [1, 2, 3, 4, 5]
    assert rollout.points.shape == (6, len(free.points), 3)
    assert torch.isnan(rollout.points[1:]).all()
    assert torch.isnan(rollout.end.velocities).all()


@pytest.mark.parametrize("substeps", [{"substeps": 20}, {"trusted": True}, {}])
def test_substeps_of_a_lossy_rollout_are_trusted(free, state, substeps):
    with pytest.raises(ValueError, match="trusted"):
        Simulator(free, [Gravity()]).rollout(state, frames=2, lossy=True, **substeps)
