import pytest
import torch

from model.errors import InputError
from model.simulator.forces.gravity import Gravity
from model.simulator.forces.spring import Spring
from model.simulator.simulator import Simulator
from model.simulator.system import System


def build(**changes):
    given = dict(
        points=torch.eye(3),
        mass=torch.ones(3),
        springs=torch.tensor([[0, 1], [1, 2]]),
        rest_length=torch.ones(2),
        controller_springs=torch.tensor([[0, 2]]),
        controller_rest_length=torch.zeros(1),
        controller_points=torch.zeros(1, 3),
    )
    return System(**{**given, **changes})


def test_sizes():
    system = build()
    assert [system.size(over) for over in ("points", "springs", "controllers", "edges")] == [3, 2, 1, 3]
    assert system.size("scene") is None
    assert system.controller_count == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"points": torch.full((3, 3), float("nan"))}, "points of the system are not finite"),
        ({"mass": torch.tensor([1.0, 0.0, 1.0])}, "mass of the system has a zero"),
        ({"mass": torch.tensor([1.0, -1.0, 1.0])}, "mass of System is negative"),
        ({"mass": torch.ones(2)}, r"mass of the system has shape \[2\]"),
        ({"rest_length": torch.ones(3)}, r"rest_length of the system has shape \[3\]"),
        ({"springs": torch.tensor([[0, 1], [1, 3]])}, "springs of the system points outside its 3 points"),
        ({"springs": torch.tensor([[0, 1], [-1, 2]])}, "springs of the system points outside its 3 points"),
        ({"springs": torch.tensor([[0, 1], [2, 2]])}, "joins a point with itself"),
        ({"controller_springs": torch.tensor([[1, 2]])}, "outside its 1 controllers"),
        (
            {"controller_springs": torch.tensor([[0, 5]])},
            "controller_springs of the system points outside its 3 points",
        ),
    ],
)
def test_bad_systems_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        build(**change)


def test_terms_must_fit_the_system():
    with pytest.raises(InputError, match=r"stiffness of spring has shape \[7\]: give one value or 2 of them"):
        Simulator(build(), [Spring(torch.ones(7))])
    with pytest.raises(InputError, match=r"gravity of gravity has shape \[\]: give 3 numbers"):
        Simulator(build(), [Gravity(9.81)])


def test_other_constants_over_the_same_graph(system):
    heavier = system.with_values(mass=2.0 * system.value("mass"))
    torch.testing.assert_close(heavier.value("mass"), 2.0 * system.value("mass"))
    torch.testing.assert_close(heavier.value("rest_length"), system.value("rest_length"))
    for name in ("first", "second"):
        torch.testing.assert_close(getattr(heavier.edges, name), getattr(system.edges, name))
    assert heavier.controller_count == system.controller_count
