from dataclasses import replace

import numpy as np
import pytest

from model.errors import InputError


def test_cases_say_what_does_not_fit(make_case):
    case = make_case()
    with pytest.raises(InputError, match="2 parts but 1 priors"):
        replace(case, priors=case.priors[:1])
    with pytest.raises(InputError, match=r"split 99 of 16 frames"):
        replace(case, split=99)
    few = replace(case.anchors, index=case.anchors.index[1:], weight=case.anchors.weight[1:])
    with pytest.raises(InputError, match="40 observed points, but 39 anchors"):
        replace(case, anchors=few)


def test_the_lifted_end_follows_the_hand(make_case):
    case = make_case(frames=20)
    moved = case.complete[-1] - case.complete[0]
    near = case.rest[:, 0] < 0.03
    assert near.any()
    np.testing.assert_allclose(moved[near, 2], 0.25, atol=0.04)
