import shutil

import pytest

from model.errors import InputError
from model.predictor import ALL_PREDICTORS
from model.predictor.named import predictor_named
from model.predictor.trained import SHIPPED, TrainedPredictor


@pytest.mark.parametrize("method", ALL_PREDICTORS)
def test_every_predictor_has_a_name(method):
    assert type(predictor_named(method.name)) is method


def test_a_file_is_read(tmp_path):
    path = tmp_path / "mine.safetensors"
    shutil.copy(SHIPPED, path)
    mine = predictor_named(str(path))
    assert isinstance(mine, TrainedPredictor)
    assert mine.weights == TrainedPredictor().weights


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InputError, match=r"none\.safetensors"):
        predictor_named(str(tmp_path / "none.safetensors"))


def test_there_is_no_other_and_the_message_lists_them():
    with pytest.raises(InputError, match=r"--predictor oracle: choose matphys, prior-mean, or a \.safetens"):
        predictor_named("oracle")
    with pytest.raises(InputError, match=r"--predictor oracle: choose auto, matphys, prior-mean, or a \."):
        predictor_named("oracle", "auto")
