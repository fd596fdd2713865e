"""What another recording suggests of an effect."""

import pytest
import torch

from model.gap.effects import GravityTilt
from model.gap.elsewhere import Elsewhere
from model.gap.transfer import transferred

TILT = {"gravity_tilt.about_x": 0.2, "gravity_tilt.about_y": 0.1}


@pytest.fixture
def there(hung, studied, shaken):
    """A function: the plain twin in another recording, in which gravity is tilted so."""

    def make(tilt):
        first = studied(hung)
        seen = studied(shaken(hung, 0.06), (GravityTilt(),), tilt).observation
        return Elsewhere.of(transferred(first, seen).study(first))

    return make


def test_what_is_at_work_there_is_suggested_about_as_strong(there):
    found = there(TILT).suggests("gravity_tilt")
    assert found == pytest.approx(TILT, rel=0.4)


def test_what_explains_nothing_there_is_not(there):
    assert there({}).suggests("quadratic_air_drag") is None


def test_nor_what_acts_nowhere(there):
    """The plain twin gains by a step of its own as much."""
    elsewhere = there(TILT)
    nowhere = torch.zeros(len(elsewhere.study.plain.twin.body.points), dtype=torch.float64)
    assert elsewhere.suggests("quadratic_air_drag", nowhere) is None


def test_nor_what_cannot_act_there(there):
    """The sheet hangs over no ground."""
    assert there(TILT).suggests("adhesion") is None
