"""What stands beside the stage, used as a person would: real clicks in a real page."""

from dataclasses import replace

import numpy as np
import pytest
from playwright.sync_api import expect

from model.bundle import TwinBundle
from model.priors.materials import MATERIALS, typical
from model.schema import PartRecord, PropertyRecord

pytestmark = pytest.mark.slow


@pytest.fixture
def told_twin(green_twin):
    """The green twin, which says what its two parts are made of."""
    bundle = TwinBundle.load(green_twin)
    chances = {name: float(name == "fabric") for name in MATERIALS}
    prior = {
        name: PropertyRecord(mean=belief.mean, spread=belief.spread, unit=belief.unit)
        for name, belief in typical("fabric", "solid").items()
    }
    labels = ("head", "body")
    parts = tuple(PartRecord(label=label, materials=chances, prior=prior) for label in labels)
    replace(bundle, parts=parts).save(green_twin)
    return green_twin


def test_a_part_is_made_of_another_material(play, told_twin):
    page = play(told_twin)
    before = page.session.bundle
    page.choose("Part", "1: body")
    page.choose("Made of", "rubber")
    page.button("Predict its springs").click()
    page.wait(lambda: page.session.moment.resets == 1, "the springs to be predicted")
    after = page.session.edited()
    inside = before.topology.part == 1
    assert after.parts[1].materials["rubber"] == 1
    assert after.topology.mass[inside].sum() > 1.5 * before.topology.mass[inside].sum()
    np.testing.assert_array_equal(after.topology.mass[~inside], before.topology.mass[~inside])
    expect(page.page.get_by_text("1: body: rubber")).to_be_visible()
    page.choose("Made of", "as it was")
    page.button("Predict its springs").click()
    page.wait(lambda: page.session.moment.resets == 2, "the part to be as it was")
    assert page.session.edited() is before
