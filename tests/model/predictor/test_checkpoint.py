import json

import pytest
import torch
from safetensors.torch import save_file

from model.errors import InputError
from model.predictor.checkpoint import KEY, About, load_predictor, model_card, save_predictor
from model.predictor.options import NetworkOptions
from model.predictor.trained import SHIPPED

OPTIONS = NetworkOptions(dim=8, layers=1, heads=2, codebook=False)


@pytest.fixture
def network():
    torch.manual_seed(0)
    network = OPTIONS.build(5, 3)
    network.calibrate(1.7, torch.tensor([1.0, 2.0, 0.5, 1.5]).numpy())
    return network


def about(**values):
    known = {"options": OPTIONS.as_dict(), "motion_dim": 5, "motion_global_dim": 3}
    return About(**known, encoder="kinematic", encoder_version="1", **values)


def test_what_is_saved_is_loaded(network, make_case, sample_of, tmp_path):
    path = tmp_path / "p.safetensors"
    save_predictor(path, network, about(data={"seed": 3}, validation={"rank_right": 0.9}))
    known = load_predictor(path)
    assert known.options == OPTIONS
    assert known.widths == (5, 3)
    assert known.about.data["seed"] == 3
    assert not known.network.training
    sample = sample_of(make_case(frames=4))
    with torch.no_grad():
        expected, found = network.eval()(sample), known.network(sample)
    torch.testing.assert_close(found.log_modulus, expected.log_modulus, rtol=0, atol=0)
    torch.testing.assert_close(found.part_log_spread, expected.part_log_spread, rtol=0, atol=0)
    card = path.with_suffix(".md").read_text()
    assert "rank right: 0.9" in card
    assert "seed: 3" in card


def test_a_card_says_of_recorded_cases_that_they_are(network, tmp_path):
    path = tmp_path / "p.safetensors"
    save_predictor(path, network, about(data={"seed": None}, calibration={"parts": 1.0, "looks": 0.0}))
    card = path.with_suffix(".md").read_text()
    assert "not generated" in card
    assert "no recording" not in card
    assert "no truth of a held-out object is known" in card
    assert "were multiplied" not in card


def test_the_card_that_is_shipped_is_that_of_the_file():
    known = load_predictor(SHIPPED)
    weights = sum(value.numel() for value in known.network.state_dict().values())
    card, shipped = model_card(known.about, weights), SHIPPED.with_suffix(".md").read_text()
    assert sorted(card.splitlines()) == sorted(shipped.splitlines())  # entries of a file are sorted by name


def test_equal_weights_and_words_give_equal_bytes(network, tmp_path):
    paths = [tmp_path / name for name in ("a.safetensors", "b.safetensors")]
    for path in paths:
        save_predictor(path, network, about(data={"seed": 3, "folder": "cases"}))
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert load_predictor(paths[0]).sha256 == load_predictor(paths[1]).sha256


def test_what_is_no_predictor_is_refused_in_one_line(network, tmp_path):
    path = tmp_path / "p.safetensors"
    with pytest.raises(InputError, match="no such file"):
        load_predictor(path)
    path.write_bytes(b"nonsense")
    with pytest.raises(InputError, match="not a safetensors file"):
        load_predictor(path)
    save_file({"x": torch.zeros(2)}, path)
    with pytest.raises(InputError, match="not a predictor"):
        load_predictor(path)
    text = json.dumps(about().model_dump(by_alias=True))
    save_file({"x": torch.zeros(2)}, path, metadata={KEY: text})
    with pytest.raises(InputError, match="weights are not those of its options"):
        load_predictor(path)
    other = json.dumps({**about().model_dump(by_alias=True), "options": {"dims": 3}})
    save_file({"x": torch.zeros(2)}, path, metadata={KEY: other})
    with pytest.raises(InputError, match="dims"):
        load_predictor(path)


def test_options_go_there_and_back():
    assert NetworkOptions.from_dict(OPTIONS.as_dict()) == OPTIONS
    with pytest.raises(InputError, match="heads"):
        NetworkOptions.from_dict({"heads": "four"})


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_weights_that_are_no_numbers_are_refused(network, tmp_path, value):
    path = tmp_path / "p.safetensors"
    with torch.no_grad():
        name, tensor = next(iter(network.named_parameters()))
        tensor.view(-1)[0] = value
    save_predictor(path, network, about())
    with pytest.raises(
        InputError, match=f"weights that are NaN or infinite, in {name}: its training diverged"
    ):
        load_predictor(path)
