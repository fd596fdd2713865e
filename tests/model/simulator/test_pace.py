"""A law that stiffens: stable at rest, and out of the bound of rest where it is stretched."""

from contextlib import suppress

import pytest
import torch

from model.errors import InputError
from model.simulator.divergence import SimulationDiverged
from model.simulator.forces.base import AxialForce
from model.simulator.forces.controller import ControllerSpring
from model.simulator.forces.dashpot import Dashpot
from model.simulator.pace import MARGIN, Pace, StabilityWarning
from model.simulator.parameters import Constant
from model.simulator.simulator import Simulator
from model.simulator.system import System

pytestmark = pytest.mark.usefixtures("backend")
COUNT, SPACING, FPS = 6, 0.1, 120.0


class Stiffening(AxialForce):
    """k s (1 + 10 s²/L²): stretched by half, 8.5 times as stiff as at rest."""

    name = "stiffening"
    internal = central = True
    constants = {"stiffness": Constant("N/m", "springs", (1.0, 1e4))}  # noqa: RUF012

    def __init__(self, stiffness):
        super().__init__(stiffness=stiffness)

    @staticmethod
    def law(length, rest_length, stiffness):
        stretch = length - rest_length
        return stiffness * stretch * (1.0 + 10.0 * (stretch / rest_length) ** 2)


@pytest.fixture
def strap():
    """A chain of light points that two hands hold by its ends."""
    places = torch.zeros((COUNT, 3), dtype=torch.float64)
    places[:, 0] = SPACING * torch.arange(COUNT)
    index = torch.arange(COUNT)
    system = System(
        points=places,
        mass=1e-3,
        springs=torch.stack([index[:-1], index[1:]], 1),
        rest_length=SPACING,
        controller_springs=torch.tensor([[0, 0], [1, COUNT - 1]]),
        controller_points=places[[0, -1]],
    )
    return Simulator(system, [Stiffening(3e4), ControllerSpring(3e4), Dashpot(0.5)])


def hands(*reaches):
    """Where the hands are when the second is out by each of these [m]."""
    places = torch.zeros((len(reaches), 2, 3), dtype=torch.float64)
    places[:, 1, 0] = SPACING * (COUNT - 1) + torch.tensor(reaches)
    return places


OUT_AND_BACK = hands(0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.25, 0.2, 0.15, 0.1, 0.05, 0.0, 0.0, 0.0)
OUT = OUT_AND_BACK[:7]
JERK = hands(0.0, 0.3, 0.3)
SLOWLY = hands(*(0.01 * frame for frame in range(31)))


def test_substeps_follow_the_bound(strap):
    """As many as the strap needs while it is stretched, and few again afterwards."""
    found = strap.rollout(controls=OUT_AND_BACK, fps=FPS)
    fine = strap.rollout(controls=OUT_AND_BACK, fps=FPS, substeps=4 * max(found.substeps))
    assert max(found.substeps) > 1.8 * found.substeps[0]
    assert found.substeps[-1] < 0.7 * max(found.substeps)
    assert (found.points - fine.points).abs().max() < 0.01


@pytest.mark.parametrize("controls", [OUT, JERK], ids=["pulled", "jerked"])
def test_without_it_the_same_run_explodes(strap, controls, monkeypatch):
    calm = strap.rollout(controls=controls, fps=FPS)
    assert calm.points.abs().max() < 1.0
    monkeypatch.setattr(Pace, "accepts", lambda *given: True)
    with pytest.raises(SimulationDiverged):
        strap.rollout(controls=controls, fps=FPS)


def test_a_frame_that_left_the_bound_is_done_again(strap):
    """Jerked so that it stretches within the first frame, it ends where fine steps end."""
    found = strap.rollout(controls=JERK, fps=FPS)
    fine = strap.rollout(controls=JERK, fps=FPS, substeps=4 * max(found.substeps))
    assert found.substeps[0] > 1.5 * strap.needed_substeps(1 / FPS)
    assert (found.points - fine.points).abs().max() < 0.02


@pytest.mark.parametrize("share", [1.1, 0.9], ids=["in a frame", "at the start"])
def test_too_few_given_are_told_with_the_frame(strap, share):
    """Once, whatever comes of it."""
    given = round(share * strap.needed_substeps(1 / FPS) / MARGIN)
    with (
        pytest.warns(StabilityWarning, match=f"{given} substeps per frame: stability needs") as told,
        suppress(SimulationDiverged),
    ):
        strap.rollout(controls=SLOWLY, fps=FPS, substeps=given)
    (warning,) = (each.message for each in told)
    assert (warning.frame > 0) == (share > 1.0)
    assert warning.used == given < warning.needed


def test_enough_given_are_not_told(strap):
    """Warnings are errors here."""
    strap.rollout(controls=OUT, fps=FPS, substeps=3 * strap.needed_substeps(1 / FPS))


def test_trusted_ones_are_taken_as_they_are(strap):
    """Warnings are errors here: too few are not told either."""
    enough = 3 * strap.needed_substeps(1 / FPS)
    looked_at, trusted = (
        strap.rollout(controls=OUT, fps=FPS, substeps=enough, trusted=known) for known in (False, True)
    )
    assert torch.equal(looked_at.points, trusted.points)
    assert trusted.substeps == (enough,) * (len(OUT) - 1)
    few = round(0.9 * strap.needed_substeps(1 / FPS) / MARGIN)
    with suppress(SimulationDiverged):
        strap.rollout(controls=SLOWLY, fps=FPS, substeps=few, trusted=True)
    with pytest.raises(InputError, match="substeps is 0"):
        strap.rollout(controls=OUT, fps=FPS, substeps=0, trusted=True)


@pytest.mark.parametrize(
    "asked",
    [{"fps": 1e-7}, {"substeps": 1_000_001}, {"substeps": 1_000_001, "trusted": True}],
    ids=["found", "given", "trusted"],
)
def test_more_substeps_than_can_be_paid_are_refused(strap, asked):
    """As for times in nanoseconds; who tries candidates takes it for one that diverges."""
    with pytest.raises(SimulationDiverged, match=r"would take .* substeps, and 1000000 are the most: give"):
        strap.rollout(controls=OUT[:2], **({"fps": FPS} | asked))
