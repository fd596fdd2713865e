from pathlib import Path

import pytest

from model.errors import InputError
from model.evaluation.baselines import ALL_METHODS
from model.evaluation.methods import KNOWN, chosen


def test_names_in_their_order():
    assert list(chosen("prior_mean, hold-last")) == ["prior-mean", "hold-last"]


def test_a_predictor_under_a_name_of_its_own(tmp_path):
    path = tmp_path / "ablation.safetensors"
    path.write_bytes(b"weights")
    methods = chosen(f"no-motion={path},hold-last")
    assert list(methods) == ["no-motion", "hold-last"]
    assert methods["no-motion"].path == path


def test_every_method_has_a_name_of_its_own():
    names = [method.name for method in KNOWN]
    assert len(set(names)) == len(names) == len(ALL_METHODS) + 1
    for method in ALL_METHODS:
        assert list(chosen(method.name)) == [method.name]


def test_the_page_names_every_method():
    page = Path(__file__).resolve().parents[3] / "docs" / "evaluation.md"
    for method in ALL_METHODS:
        assert f"| `{method.name}` |" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("guess", "no method 'guess': choose from matphys, hold-last"),
        ("hold-last,hold_last", "named twice"),
        (" , ", "expected names"),
        ("ours=none.safetensors", "no such predictor"),
    ],
)
def test_what_cannot_be_chosen(written, message):
    with pytest.raises(InputError, match=message):
        chosen(written)
