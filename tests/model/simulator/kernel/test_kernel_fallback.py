"""What the kernel cannot do is named, and left to the torch oracle."""

from collections.abc import Mapping
from typing import ClassVar

import pytest
import torch

from model.errors import InputError
from model.simulator.backend import FallbackWarning
from model.simulator.contacts.self_collision import SelfCollision
from model.simulator.forces.base import AxialForce
from model.simulator.forces.unprojected_dashpot import UnprojectedDashpot
from model.simulator.kernel import build
from model.simulator.parameters import Constant

by_both = pytest.mark.usefixtures("engine")
"""Once with the processor's kernel, once with that of CUDA."""


class Jagged(AxialForce):
    """A law that no symbol follows."""

    name = "jagged"
    constants: ClassVar[Mapping[str, Constant]] = {"stiffness": Constant("N/m", "scene", (1.0, 2.0))}

    def __init__(self):
        super().__init__(stiffness=1.0)

    @staticmethod
    def law(length, stiffness):
        return torch.floor(length * 1e9) * 1e-9 * stiffness


@by_both
@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda s: s.with_force(UnprojectedDashpot(0.1)), "the force 'unprojected_dashpot'"),
        (lambda s: s.with_force(Jagged()), "law of 'jagged' cannot be traced: torch.floor"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_what_it_cannot_do_is_named_and_left_to_the_oracle(scene, change, complaint):
    made = scene()
    simulator = change(made.simulator)
    with pytest.raises(InputError, match=complaint):
        simulator.with_backend("kernel").rollout(made.state(), made.controls[:2], substeps=40)
    with pytest.warns(FallbackWarning, match=complaint):
        found = simulator.rollout(made.state(), made.controls[:2], substeps=40)
    expected = simulator.with_backend("torch").rollout(made.state(), made.controls[:2], substeps=40)
    assert torch.equal(found.points, expected.points)


def test_self_collision_is_no_part_of_it(scene):
    made = scene()
    simulator = made.simulator.with_contact(SelfCollision(made.simulator.system, 0.01, 0.0, 0.0))
    with pytest.raises(InputError, match="the contact 'self_collision'"):
        simulator.with_backend("kernel").rollout(made.state(), made.controls[:2], substeps=40)


@pytest.mark.filterwarnings("error")
def test_without_a_compiler_the_oracle_serves_and_says_so(scene, monkeypatch):
    made = scene()
    monkeypatch.setenv("PATH", "")
    build.load.cache_clear()
    with pytest.warns(FallbackWarning, match=r"no C\+\+ compiler"):
        found = made.simulator.rollout(made.state(), made.controls[:2], substeps=40)
    build.load.cache_clear()
    expected = made.simulator.with_backend("torch").rollout(made.state(), made.controls[:2], substeps=40)
    assert torch.equal(found.points, expected.points)
