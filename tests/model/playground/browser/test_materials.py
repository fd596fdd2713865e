from dataclasses import replace

import numpy as np
import pytest

from model.edit import edit_part
from model.errors import InputError
from model.playground.browser.materials import remade
from model.priors.materials import MATERIALS, typical
from model.schema import PartRecord, PropertyRecord


@pytest.fixture
def fabric(plain_twin):
    """The twin, which says of both its parts that they are fabric."""
    prior = {
        name: PropertyRecord(mean=belief.mean, spread=belief.spread, unit=belief.unit)
        for name, belief in typical("fabric", "solid").items()
    }
    chances = {name: float(name == "fabric") for name in MATERIALS}
    parts = tuple(PartRecord(label=number, materials=chances, prior=prior) for number in range(2))
    return replace(plain_twin, parts=parts)


def test_parts_are_remade_as_the_command_does_it(fabric):
    twin = remade(fabric, {1: "leather", 0: "rubber"})
    expected = edit_part(edit_part(fabric, 0, "rubber"), 1, "leather")
    np.testing.assert_array_equal(twin.parameters.stiffness, expected.parameters.stiffness)
    np.testing.assert_array_equal(twin.topology.mass, expected.topology.mass)
    assert twin.manifest.id == expected.manifest.id


def test_as_it_was_is_the_twin_that_came(fabric):
    assert remade(fabric, {}) is fabric


def test_a_twin_that_does_not_say_what_it_is_made_of_is_refused(plain_twin):
    with pytest.raises(InputError, match="parts"):
        remade(replace(plain_twin, parts=()), {0: "rubber"})
