import io

import cv2
import numpy as np
import pytest

from model.errors import InputError
from model.reconstruction.depth_file import read_depth


def archive():
    """The bytes of a .npz, which somebody may call .npy."""
    data = io.BytesIO()
    np.savez(data, depth=np.full((30, 40), 600, np.uint16))
    return data.getvalue()


ARCHIVE = archive()


def millimetres(value=600):
    return np.full((30, 40), value, np.uint16)


def test_png_and_npy_are_millimetres(tmp_path):
    raw = millimetres()
    raw[0, 0] = 0
    cv2.imwrite(str(tmp_path / "d.png"), raw)
    np.save(tmp_path / "d.npy", raw.astype(np.float32))
    for name in ("d.png", "d.npy"):
        depth = read_depth(tmp_path / name, 0, 1, 30, 40)
        assert depth[0, 0] == 0.0
        assert depth[5, 5] == pytest.approx(0.6)


def test_a_folder_is_read_in_the_order_of_its_numbers(tmp_path):
    for index in range(12):
        cv2.imwrite(str(tmp_path / f"{index}.png"), millimetres(500 + index))
    (tmp_path / "notes.txt").write_text("not depth")
    assert read_depth(tmp_path, 2, 12, 30, 40)[0, 0] == pytest.approx(0.502)
    assert read_depth(tmp_path, 10, 12, 30, 40)[0, 0] == pytest.approx(0.510)


def test_depth_of_the_clips_own_size_is_taken_where_its_images_were_made_smaller(tmp_path):
    raw = np.kron(np.array([[500, 900], [700, 0]]), np.ones((30, 40))).astype(np.uint16)
    cv2.imwrite(str(tmp_path / "d.png"), raw)
    depth = read_depth(tmp_path / "d.png", 0, 1, 30, 40, source_size=(80, 60))
    assert depth.shape == (30, 40)
    assert set(np.unique(depth)) == {0.0, 0.5, 0.7, 0.9}, "no mixtures"
    assert (depth[:15, :20] == 0.5).all()
    with pytest.raises(InputError, match="does not fit the clip's 100×75"):
        read_depth(tmp_path / "d.png", 0, 1, 30, 40, source_size=(100, 75))


def test_missing_and_bad_numbers_become_zero(tmp_path):
    raw = millimetres().astype(np.float64)
    raw[0, :3] = [np.nan, np.inf, -5.0]
    np.save(tmp_path / "d.npy", raw)
    np.testing.assert_array_equal(read_depth(tmp_path / "d.npy", 0, 1, 30, 40)[0, :4], [0, 0, 0, 0.6])


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("d.png", b"", "not a readable"),
        ("d.png", b"no image", "not a readable"),
        ("d.npy", b"no array", "not a readable"),
        ("d.npy", b"", "not a readable"),
        ("d.npy", ARCHIVE, "not a readable"),
        ("d.npy", b"\x93NUMPY\x01\x00\x10\x00{'descr': ('<u2' \n", "not a readable"),
        ("d.tif", b"", "16-bit"),
        ("d.npy", np.zeros((30, 40), np.uint8), "one channel"),
        ("d.npy", np.zeros((30, 40, 3), np.uint16), "one channel"),
        ("d.npy", np.full((40, 30), 600, np.uint16), "does not fit"),
        ("d.npy", np.full((30, 40), 0.6), "millimetres"),
        ("d.npy", np.zeros((30, 40), np.uint16), "no pixel"),
        ("d.npy", np.array([object()]), "not a readable"),
    ],
)
def test_wrong_depth_is_named_in_one_line(tmp_path, name, content, said):
    path = tmp_path / name
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        np.save(path, content, allow_pickle=True)
    with pytest.raises(InputError) as caught:
        read_depth(path, 0, 1, 30, 40)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_folder_must_have_one_image_per_frame(tmp_path):
    cv2.imwrite(str(tmp_path / "0.png"), millimetres())
    with pytest.raises(InputError, match="1 numbered depth images"):
        read_depth(tmp_path, 0, 2, 30, 40)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_depth(tmp_path / "none.png", 0, 1, 30, 40)
