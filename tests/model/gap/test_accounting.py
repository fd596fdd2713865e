"""What is left with an effect and without it, in one recording or in two."""

import numpy as np
import pytest

from model.gap.account import MOST, Explained
from model.gap.accounting import account_of
from model.gap.confirm import held_out
from model.gap.effects import QuadraticAirDrag
from model.gap.schema import EFFECT_NAMES
from model.gap.transfer import transferred
from model.gap.verdict import Judged

DRAG = "quadratic_air_drag.drag_per_mass"
SCREENED = Judged(dict.fromkeys([*EFFECT_NAMES, "none", "unknown"], 1.0 / 19.0))


@pytest.fixture
def dragged(hung, studied):
    return studied(hung, (QuadraticAirDrag(),), {DRAG: 4.0})


def test_of_one_recording(dragged, twin):
    plain, dragging = twin(dragged), twin(dragged, (QuadraticAirDrag(),), {DRAG: 4.0})
    account = account_of(dragged, None, plain, {"quadratic_air_drag": dragging}, SCREENED, dragging)
    assert held_out(dragged, dragging.foretold) < held_out(dragged, plain.foretold)
    one = account.explained["quadratic_air_drag"]
    assert one.fitted > 3.0
    assert one.later > 0.5
    assert one.slowly > 0.5
    assert one.elsewhere == one.slowly_elsewhere == 0.0
    assert account.shared == {}
    assert account.told == account.explained
    assert len(account.left) == len(account.lattices) == 1
    assert account.lattices[0] > 0.0
    assert set(account.screened) == set(EFFECT_NAMES)
    assert account.flexible == one, "all that is missing is explained as by the effect"


def test_of_two_an_effect_that_the_first_gets_wrong_explains_more_when_both_tell_it(
    hung, dragged, studied, shaken, twin
):
    seen = studied(shaken(hung, 0.06), (QuadraticAirDrag(),), {DRAG: 4.0}).observation
    other = transferred(dragged, seen)
    plain, wrong = twin(dragged), twin(dragged, (QuadraticAirDrag(),), {DRAG: 8.0})
    account = account_of(dragged, other, plain, {"quadratic_air_drag": wrong}, SCREENED, wrong)
    shared = account.shared["quadratic_air_drag"]
    held = other.followed(wrong).estimate.cost
    assert held > account.left[1], "as strong as the first has it, it does harm"
    assert shared.elsewhere > 0.1
    assert shared.fitted > 0.1, "linear drag takes most of it"
    assert shared.slowly > 0.1
    assert shared.slowly_elsewhere > 0.1
    assert account.told == account.shared
    assert len(account.left) == len(account.lattices) == 2
    assert account.lattices[0] != account.lattices[1]


def test_what_explains_nothing_is_tried_nowhere_else(hung, studied, shaken, twin):
    null = studied(hung)
    other = transferred(null, studied(shaken(hung, 0.06)).observation)
    plain, faint = twin(null), twin(null, (QuadraticAirDrag(),), {DRAG: 1e-4})
    account = account_of(null, other, plain, {"quadratic_air_drag": faint}, SCREENED, plain)
    assert account.explained["quadratic_air_drag"] == Explained()
    assert account.flexible is not None
    assert account.flexible == Explained()
    assert account.shared["quadratic_air_drag"] == Explained()


def test_what_has_nothing_to_act_on_elsewhere_explains_nothing_there(grounded, twin):
    study, other, one = grounded
    plain = twin(study, (), {"stiffness": 0.5 * study.base.values["stiffness"]})
    account = account_of(study, other, plain, {"static_friction": one}, SCREENED, plain)
    shared = account.shared["static_friction"]
    assert shared.fitted > 0.0
    less = np.log(plain.estimate.cost / one.estimate.cost)
    assert shared.fitted == pytest.approx(min(less, MOST[1]))
    assert shared.elsewhere == shared.slowly_elsewhere == 0.0
