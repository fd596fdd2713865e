import numpy as np
import pytest

from model.controllers.contact import centre_of, contact_groups, later_grip
from model.types import Masks

HEIGHT, WIDTH = 120, 200


def box(left, top, right, bottom):
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[top:bottom, left:right] = True
    return mask


THING = box(60, 50, 140, 80)
LEFT, RIGHT = box(30, 40, 60, 70), box(140, 60, 170, 90)


def test_each_hand_is_one_grip_on_the_object():
    grips = contact_groups(THING, LEFT | RIGHT)
    assert len(grips) == 2
    assert all((grip <= THING).all() for grip in grips)
    columns = sorted(centre_of(grip)[0] for grip in grips)
    assert columns[0] < 66
    assert columns[1] > 134


def test_fingers_of_one_hand_are_one_grip_and_a_forearm_is_none():
    two_fingers = LEFT.copy()
    two_fingers[55:60, 52:60] = False
    assert len(contact_groups(THING, two_fingers)) == 1
    arm = LEFT | box(30, 20, 135, 30) | box(30, 20, 40, 60) | box(125, 20, 135, 49)
    grips = contact_groups(THING, arm)
    assert len(grips) == 1
    assert centre_of(grips[0])[0] < 66


def test_apart_is_no_contact():
    assert contact_groups(THING, box(10, 40, 50, 70)) == []
    assert contact_groups(THING, np.zeros_like(THING)) == []


@pytest.mark.parametrize(("lasting", "expected"), [(20, 4), (3, None)])
def test_a_later_grip_lasts(lasting, expected):
    hand = np.repeat(LEFT[None], 24, axis=0)
    hand[4 : 4 + lasting] |= RIGHT
    masks = Masks(np.repeat(THING[None], 24, axis=0), hand, 0)
    known = np.repeat(np.array([[62.0, 60.0]]), 24, axis=0)
    found = later_grip(masks, 0, [known])
    if expected is None:
        assert found is None
    else:
        assert found is not None
        assert found[0] == expected
        assert centre_of(found[1])[0] > 134
        assert later_grip(masks, 0, [known, np.repeat(np.array([[138.0, 70.0]]), 24, axis=0)]) is None
