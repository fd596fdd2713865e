import pytest

from model.errors import InputError
from model.formats.shapes import check_shape


def test_a_letter_is_one_number_throughout():
    sizes = {"K": 4}
    check_shape("points", (7, 3), ("P", 3), sizes, "file")
    assert sizes == {"K": 4, "P": 7}
    check_shape("shares", (7, 4), ("P", "K"), sizes, "file")
    with pytest.raises(InputError, match=r"^file: mass: expected shape \[7\], found \[6\]$"):
        check_shape("mass", (6,), ("P",), sizes, "file")


@pytest.mark.parametrize("found", [(), (5,), (5, 2), (5, 3, 1)])
def test_another_shape_is_refused_and_says_nothing_of_its_letters(found):
    sizes = {}
    with pytest.raises(InputError, match=r"expected shape \[N, 3\], found"):
        check_shape("points", found, ("N", 3), sizes, "file")
    assert not sizes
