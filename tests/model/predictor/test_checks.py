import pytest
import torch

from model.errors import InputError
from model.predictor.checks import at_least, finite


def test_the_first_option_that_is_less_is_named():
    at_least(1, "data", batch_size=1, workers=2)
    with pytest.raises(InputError, match=r"^data\.workers is 0: expected 1 or more$"):
        at_least(1, "data", batch_size=1, workers=0)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_what_is_no_number_is_as_little_an_option(value):
    with pytest.raises(InputError, match=rf"^model\.weight is {value}: expected 0 or more$"):
        at_least(0, "model", weight=value)


def test_one_number_that_is_none_is_enough():
    assert finite(torch.tensor([1e30, -1.0]))
    assert finite(torch.zeros(0))
    assert not finite(torch.tensor([[0.0, float("nan")]]))
    assert not finite(torch.tensor([0.0, -float("inf")]))
