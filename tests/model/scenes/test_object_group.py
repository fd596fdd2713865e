import pytest

from model.scenes.object_group import object_group


@pytest.mark.parametrize(
    ("name", "group"),
    [
        ("single_lift_sloth", "sloth"),
        ("double_stretch_sloth", "sloth"),
        ("single_clift_cloth_1", "cloth"),
        ("double_lift_cloth_3", "cloth"),
        ("rope_double_hand", "rope"),
        ("weird_package", "weird_package"),
        ("cup_1", "cup_1"),
        ("plush-0-0007", "plush-0-0007"),
        ("double_lift_1", "double_lift_1"),
    ],
)
def test_a_thing_is_told_from_what_was_done_to_it(name, group):
    assert object_group(name) == group
