import pytest

from model.errors import InputError
from model.scenes.files import load_folder
from model.scenes.generate import generate


def test_the_same_files_whatever_the_number_of_processes(tmp_path):
    shares = []
    for workers in (1, 2):
        folder = tmp_path / str(workers)
        generate(
            folder,
            2,
            seed=4,
            workers=workers,
            classes=("cloth",),
            interactions=1,
            report=lambda stage, share: shares.append(share),
        )
    one, two = ({p.name: p.read_bytes() for p in (tmp_path / w).iterdir()} for w in ("1", "2"))
    assert one == two
    assert len(load_folder(tmp_path / "1")) == 2
    assert shares[-1] == 1.0


def test_objects_are_the_same_in_any_folder_of_their_seed(tmp_path):
    generate(tmp_path / "both", 2, seed=4, classes=("cloth",), interactions=1)
    index = generate(tmp_path / "second", 1, seed=4, classes=("cloth",), interactions=1, first=1)
    name = index.cases[0].file
    assert (tmp_path / "both" / name).read_bytes() == (tmp_path / "second" / name).read_bytes()


def test_a_folder_with_cases_is_left_alone(tmp_path):
    (tmp_path / "a.case.npz").write_bytes(b"")
    with pytest.raises(InputError, match="has cases already"):
        generate(tmp_path, 1)
