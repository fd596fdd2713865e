"""Shapes are checked while tests run, in the first calls of each test."""

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from model.gap.size import size_of
from tests.typechecked import FIRST


@pytest.mark.parametrize("again", [False, True])
def test_wrong_shapes_are_found_in_the_first_calls_of_each_test(again):
    wrong, right = np.zeros((4, 2)), np.eye(3)
    for places in (np.zeros(3), wrong, np.eye(3, dtype=np.float32)):
        with pytest.raises(TypeCheckError, match="places"):
            size_of(places)
    for _ in range(FIRST):
        size_of(right)
    assert size_of(wrong) == 0.0, "no longer asked"
