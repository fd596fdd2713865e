"""Jurors: probabilities of all that could be, from signs that mean the same for every effect."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from model.gap.classifier import CLASSES, NONE, Juror, Jury
from model.gap.schema import EFFECT_NAMES
from model.gap.signs import CONTEXT_NAMES, SIGN_NAMES, Signs


@pytest.fixture
def signs():
    """Of a recording in which five effects could act."""
    rng = np.random.default_rng(2)
    names = tuple(EFFECT_NAMES[i] for i in (0, 3, 8, 9, 16))
    each, context = rng.uniform(0, 1, (5, len(SIGN_NAMES))), rng.uniform(0, 1, len(CONTEXT_NAMES))
    return Signs(names, each, context, np.arange(5), np.ones(5))


@pytest.fixture
def jury():
    """Two jurors of random weights."""
    jurors = []
    for seed in range(2):
        torch.manual_seed(seed)
        juror = Juror()
        juror.bias.data.normal_()
        juror.sign_mean.uniform_()
        jurors.append(juror.eval())
    return Jury(tuple(jurors))


@pytest.mark.parametrize("which", ["shipped", "random"])
def test_probabilities_sum_to_one_and_what_cannot_act_has_none(which, jury, signs):
    chances = (Jury.shipped() if which == "shipped" else jury).probabilities([signs, signs])
    assert chances.shape == (2, len(CLASSES))
    np.testing.assert_allclose(chances.sum(1), 1.0, atol=1e-9)
    unable = [i for i, name in enumerate(EFFECT_NAMES) if name not in signs.names]
    assert chances[:, unable].max() < 1e-4
    assert chances[:, [EFFECT_NAMES.index(name) for name in signs.names]].min() > 0


def test_without_any_effect_only_none_and_unknown_are_left(jury, signs):
    nothing = replace(signs, names=(), each=signs.each[:0], probe=signs.probe[:0], scale=signs.scale[:0])
    chances = jury.probabilities([nothing])[0]
    assert chances[-2:].sum() == pytest.approx(1.0, abs=1e-6)


def test_the_order_in_which_effects_come_does_not_matter(jury, signs):
    order = [3, 0, 4, 1, 2]
    other = replace(
        signs,
        names=tuple(signs.names[i] for i in order),
        each=signs.each[order],
        probe=signs.probe[order],
    )
    np.testing.assert_allclose(jury.probabilities([other]), jury.probabilities([signs]), atol=1e-9)


def test_what_a_juror_learned_of_one_effect_holds_for_all(jury, signs):
    """With equal biases, effects that swap their signs swap their probabilities."""
    for juror in jury.jurors:
        juror.bias.data.zero_()
    swapped = replace(signs, each=signs.each[[1, 0, 2, 3, 4]])
    one, other = jury.probabilities([signs])[0], jury.probabilities([swapped])[0]
    first, second = (EFFECT_NAMES.index(name) for name in signs.names[:2])
    assert abs(one[first] - one[second]) > 1e-3
    assert one[first] == pytest.approx(other[second])
    assert one[second] == pytest.approx(other[first])


def test_caution_raises_none_and_keeps_the_others_in_proportion(jury, signs):
    before = jury.probabilities([signs])[0]
    for juror in jury.jurors:
        juror.caution.fill_(1.5)
    after = jury.probabilities([signs])[0]
    none = CLASSES.index(NONE)
    assert after[none] > before[none]
    alone = Jury(jury.jurors[:1])
    cautious = alone.probabilities([signs])[0]
    alone.jurors[0].caution.zero_()
    bold = alone.probabilities([signs])[0]
    odds = (cautious[none] / (1 - cautious[none])) / (bold[none] / (1 - bold[none]))
    assert odds == pytest.approx(np.exp(1.5), rel=1e-4)
    others = [i for i in range(len(CLASSES)) if i != none and bold[i] > 1e-6]
    ratio = cautious[others] / bold[others]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-4)


def test_a_jury_comes_back_from_its_tensors(jury, signs):
    for i, juror in enumerate(jury.jurors):
        juror.temperature.fill_(1.3 + i)
    again = Jury.of(jury.tensors())
    assert len(again.jurors) == 2
    np.testing.assert_array_equal(again.probabilities([signs]), jury.probabilities([signs]))


def test_a_jury_answers_with_the_mean_of_its_jurors(jury, signs):
    each = [Jury((juror,)).probabilities([signs]) for juror in jury.jurors]
    np.testing.assert_allclose(jury.probabilities([signs]), np.mean(each, axis=0), atol=1e-7)
