"""What a twin leaves of itself on other lattices: next to nothing where it hangs, much where it topples."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.bodies.body import body_of
from model.gap.hypothesis import Hypothesis
from model.gap.lattices import COARSER, FINER, LESS_CALM, lattices_of, left_here, left_there, same_object
from model.gap.plain import PlainTwin
from model.gap.transfer import Followed, transferred
from model.types import Observation


def still(places):
    return Observation(
        times=np.arange(12) / 30.0,
        points=np.repeat(np.asarray(places, np.float32)[None], 12, 0),
        controllers=np.zeros((12, 0, 3), np.float32),
    )


@pytest.fixture
def line():
    along = np.linspace(0.0, 0.6, 150)
    return np.stack([along, 0.02 * np.sin(6 * along), 0 * along], -1)


@pytest.fixture
def plane():
    u, v = np.meshgrid(np.linspace(0, 0.3, 17), np.linspace(0, 0.24, 13), indexing="ij")
    return np.stack([u, 0.01 * np.sin(20 * u), v], -1).reshape(-1, 3)


def stretched(observation, scale, values, base):
    """Work of stretching all of it evenly by a hundredth along its length [J], and the dashpots' share."""
    body = body_of(observation, base.shape, scale)
    twin = PlainTwin.of(body, observation)
    mine = same_object(values, Hypothesis(twin), base)
    ends = body.points[body.springs]
    way = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(way, axis=1)
    stiffness = mine["stiffness"] * twin.matter.pattern
    longer = 0.01 * way[:, 0] ** 2 / length
    dashpots = mine["damping"] * 2.0 * np.sqrt(mine["stiffness"] * np.median(twin.matter.mass))
    return 0.5 * float(stiffness @ longer**2), 0.5 * dashpots * float((longer**2).sum())


@pytest.mark.parametrize("name", ["line", "plane", "egg"])
def test_on_another_lattice_an_object_is_as_stiff_and_as_damped(name, request):
    observation = still(request.getfixturevalue(name))
    base = body_of(observation)
    values = {"stiffness": 50.0, "damping": 0.1}
    own = stretched(observation, 1.0, values, base)
    for scale in (FINER[base.shape], COARSER):
        other = stretched(observation, scale, values, base)
        assert other == pytest.approx(own, rel=0.25), scale


def test_a_hand_reaches_as_far_on_another_lattice(hung):
    twin = PlainTwin.of(body_of(hung), hung)
    finer = PlainTwin.of(body_of(hung, "sheet", 0.7), hung)
    values = {name: quantity.start for name, quantity in Hypothesis(twin).quantities.items()}
    mine = same_object(values, Hypothesis(finer), twin.body)
    assert mine["reach"] * finer.body.grasp == pytest.approx(values["reach"] * twin.body.grasp)
    assert set(mine) == set(Hypothesis(finer).quantities)


def gently(still, share=0.25):
    """The same recording, its hands going so much less far."""
    first = still.controllers[:1]
    return replace(still, controllers=(first + share * (still.controllers - first)).astype(np.float32))


def test_a_sheet_that_hangs_goes_alike_and_one_that_topples_does_not(hung, studied):
    still = gently(hung)
    hanging, upside_down = studied(still), studied(replace(still, gravity=(0.0, 0.0, 9.81)))
    alike, astray = (
        left_here(lattices_of(one), one.misfit, one.base.values) for one in (hanging, upside_down)
    )
    assert 0.0 < alike < 3.75
    assert astray > 10.0 * alike


def test_in_the_other_recording(hung, studied, shaken):
    study = studied(gently(hung))
    left = []
    for reach in (0.01, 0.06):
        other = transferred(study, studied(shaken(gently(hung), reach)).observation)
        there = other.study(study)
        left.append(
            left_there(
                lattices_of(study), study, other, study.base.values, Followed(there.misfit, there.base)
            )
        )
    assert 0.0 < left[0] < 3.75
    assert left[1] > 3.0 * left[0]


def test_of_a_twin_that_was_given_there_are_no_others(hung, studied):
    study = studied(hung)
    matter = replace(study.plain.twin.matter, given=True)
    given = replace(study, plain=replace(study.plain, twin=replace(study.plain.twin, matter=matter)))
    assert left_here(lattices_of(given), given.misfit, given.base.values) is None


def test_those_that_are_lost_to_their_time_steps_say_nothing(hung, studied):
    study = studied(hung)
    values = study.base.values | {"stiffness": 1e13}
    assert left_here(lattices_of(study), study.misfit, values) is None


def test_of_a_sheet_the_finer_one_is_less_calm_and_of_others_only_finer(hung, studied, line):
    study = studied(hung)
    values = study.base.values
    finer, coarser = lattices_of(study)
    own = study.plain.twin.body.spacing
    assert finer.hypothesis.twin.body.spacing == pytest.approx(FINER["sheet"] * own, rel=0.02)
    assert coarser.hypothesis.twin.body.spacing == pytest.approx(COARSER * own, rel=0.02)
    for name, factor in LESS_CALM.items():
        assert finer.values(values)[name] == pytest.approx(factor * values[name])
        assert coarser.values(values)[name] == pytest.approx(values[name])
    rope = replace(study, observation=still(line))
    rope = replace(rope, plain=Hypothesis(PlainTwin.of(body_of(rope.observation, "rope"), rope.observation)))
    assert [one.factors for one in lattices_of(rope)] == [{}, {}]
