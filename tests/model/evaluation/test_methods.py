from pathlib import Path

import pytest

from model.errors import InputError
from model.evaluation.baselines import ALL_METHODS
from model.evaluation.matphys import MatPhysMethod
from model.evaluation.methods import ALL, SPRING_MASS, chosen
from model.evaluation.synchronised import Synchronised
from model.predictor.trained import SHIPPED


def test_names_in_their_order():
    assert list(chosen("prior_mean, hold-last")) == ["prior-mean", "hold-last"]


def test_a_predictor_under_a_name_of_its_own(tmp_path):
    path = tmp_path / "ablation.safetensors"
    path.write_bytes(SHIPPED.read_bytes())
    methods = chosen(f"no-motion={path},hold-last,no-motion-open-loop={path}")
    assert list(methods) == ["no-motion", "hold-last", "no-motion-open-loop"]
    assert methods["no-motion"].inner.path == methods["no-motion-open-loop"].path == path


def test_every_method_has_a_name_of_its_own():
    names = [method.name for method in ALL_METHODS]
    assert len(set(names)) == len(names)
    assert list(chosen("all")) == list(ALL) == ["matphys", "matphys-open-loop", *names]
    for method in ALL_METHODS:
        assert list(chosen(method.name)) == [method.name]


def test_a_predictor_is_led_unless_its_name_says_otherwise():
    led, free = chosen("matphys,matphys-open-loop").values()
    assert isinstance(led, Synchronised)
    assert isinstance(led.inner, MatPhysMethod)
    assert isinstance(free, MatPhysMethod)
    assert led.identity() != free.identity()


def test_baselines_of_springs_can_be_led_too():
    for method in SPRING_MASS:
        (led,) = chosen(f"{method.name}-synchronised").values()
        assert isinstance(led, Synchronised)
        assert isinstance(led.inner, method)


def test_the_page_names_every_method():
    page = Path(__file__).resolve().parents[3] / "docs" / "evaluation.md"
    for method in ALL_METHODS:
        assert f"| `{method.name}` |" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("guess", "no method 'guess': choose from matphys, matphys-open-loop, hold-last"),
        ("hold-last-synchronised", "no method 'hold-last-synchronised'"),
        ("hold-last,hold_last", "named twice"),
        (" , ", "expected names"),
        ("ours=none.safetensors", "no such predictor"),
    ],
)
def test_what_cannot_be_chosen(written, message):
    with pytest.raises(InputError, match=message):
        chosen(written)
