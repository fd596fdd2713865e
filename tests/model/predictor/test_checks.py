import pytest

from model.errors import InputError
from model.predictor.checks import at_least


def test_the_first_option_that_is_less_is_named():
    at_least(1, "data", batch_size=1, workers=2)
    with pytest.raises(InputError, match=r"^data\.workers is 0: expected 1 or more$"):
        at_least(1, "data", batch_size=1, workers=0)
