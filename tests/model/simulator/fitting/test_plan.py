"""Horizons and budgets."""

import pytest

from model.errors import InputError
from model.simulator.fitting.plan import Plan, Stage, progressive


def test_horizons_grow_up_to_all_frames():
    assert progressive(2) == (2,)
    assert progressive(12) == (3, 6, 12)
    assert progressive(31) == (3, 6, 12, 20, 30, 31)
    assert progressive(150) == (3, 6, 12, 20, 30, 45, 68, 102, 150)


def test_the_last_stage_is_finer():
    assert Plan().stages(7) == (Stage(3, 1.0, False), Stage(6, 1.0, False), Stage(6, 2.0, True))
    assert Plan(refine=1.0).stages(7) == (Stage(3, 1.0, False), Stage(6, 1.0, True))
    assert Plan(horizons=(50, 2), refine=3.0).stages(10)[-1] == Stage(9, 3.0, True)


def test_what_early_stages_leave_over_goes_to_the_next():
    plan = Plan(evaluations=100, finish=0.4)
    stages = plan.stages(7)
    assert plan.budget(stages, 0, 0.0) == pytest.approx(30.0)
    assert plan.budget(stages, 1, 10.0) == pytest.approx(50.0)
    assert plan.budget(stages, 2, 35.0) == pytest.approx(65.0)
    assert plan.budget(stages, 2, 101.0) == 0.0


def test_the_last_stage_has_an_evaluation_however_small_its_share():
    plan = Plan(evaluations=10, finish=0.01)
    stages = plan.stages(7)
    assert plan.budget(stages, 1, 2.0) == pytest.approx(7.0)
    assert plan.budget(stages, 2, 9.0) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"evaluations": 0}, "0 evaluations"),
        ({"restarts": -1}, "-1 restarts"),
        ({"finish": 0.0}, "finish in 0"),
        ({"refine": 0.5}, "refine from 1"),
        ({"horizons": (0,)}, r"horizons are \(0,\)"),
    ],
)
def test_plans_that_cannot_be(options, said):
    with pytest.raises(InputError, match=said):
        Plan(**options)
    with pytest.raises(InputError, match="two frames or more, and has 1"):
        Plan().stages(1)
