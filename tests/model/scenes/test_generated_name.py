import pytest

from model.scenes.generated_name import GeneratedName


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("plush-0-0007", GeneratedName("plush", 0, 7)),
        ("rope-1000-12345", GeneratedName("rope", 1000, 12345)),
        ("bar-0", None),
        ("single_lift_cloth_1", None),
        ("plush-0-0007-lift", None),
    ],
)
def test_a_name_says_of_which_world_an_object_is(text, name):
    assert GeneratedName.read(text) == name
    assert name is None or str(name) == text
