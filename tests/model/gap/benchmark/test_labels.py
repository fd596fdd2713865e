import hashlib
import json
from pathlib import Path

import pytest

from model.errors import InputError
from model.gap.benchmark.labels import LOG, PLAIN, SEALED, check_labels, masked, open_labels, seal

LABELS = [{"world": "ab", "effects": [], "accepted": ["wind"], "acts_on": {"wind": [0.5, 1.0]}}]
TEXT = json.dumps(LABELS).encode()


def test_sealed_labels_open_when_predictions_are_there(tmp_path: Path):
    (tmp_path / SEALED).write_bytes(seal(TEXT))
    assert b"wind" not in (tmp_path / SEALED).read_bytes()
    with pytest.raises(InputError, match="give the file of predictions"):
        open_labels(tmp_path)
    assert not (tmp_path / LOG).exists()
    predictions = tmp_path / "predictions.json"
    predictions.write_text("{}")
    assert open_labels(tmp_path, predictions) == LABELS
    open_labels(tmp_path, predictions)
    entries = json.loads((tmp_path / LOG).read_text())
    assert [entry["predictions"] for entry in entries] == [hashlib.sha256(b"{}").hexdigest()] * 2


def test_that_the_opening_of_a_seal_can_be_logged_is_known_first(tmp_path: Path):
    (tmp_path / SEALED).write_bytes(seal(TEXT))
    check_labels(tmp_path)
    (tmp_path / LOG).mkdir()
    with pytest.raises(InputError, match=LOG):
        check_labels(tmp_path)


def test_a_damaged_log_is_refused_and_kept(tmp_path: Path):
    (tmp_path / SEALED).write_bytes(seal(TEXT))
    (tmp_path / "predictions.json").write_text("{}")
    (tmp_path / LOG).write_text("[{")
    with pytest.raises(InputError, match="expected the log"):
        open_labels(tmp_path, tmp_path / "predictions.json")
    assert (tmp_path / LOG).read_text() == "[{"


@pytest.mark.parametrize("place", [3, 40, -3])
def test_changed_labels_are_refused(tmp_path: Path, place: int):
    data = bytearray(seal(TEXT))
    data[place] ^= 1
    (tmp_path / SEALED).write_bytes(bytes(data))
    (tmp_path / "predictions.json").write_text("{}")
    with pytest.raises(InputError, match="was changed"):
        open_labels(tmp_path, tmp_path / "predictions.json")


def test_plain_labels_need_nothing(tmp_path: Path):
    with pytest.raises(InputError, match="found neither"):
        open_labels(tmp_path)
    (tmp_path / PLAIN).write_bytes(TEXT)
    assert open_labels(tmp_path) == LABELS
    for broken in (b"{", b'[{"world": "ab"}]', b"[1]"):
        (tmp_path / PLAIN).write_bytes(broken)
        with pytest.raises(InputError, match="expected a list of labels"):
            open_labels(tmp_path)


def test_a_mask_undoes_itself():
    data = bytes(range(100))
    assert masked(data) != data
    assert masked(masked(data)) == data
