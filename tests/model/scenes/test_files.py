import json
import zipfile
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest

from model.errors import InputError
from model.formats.archive import write_archive
from model.scenes.files import INDEX, describe, load_case, load_folder, read_index, save_case, write_index
from model.types import Camera, Gaussians


@pytest.fixture
def full_case(make_case):
    """With everything that a case may have."""
    case = make_case(frames=5)
    count = 7
    gaussians = Gaussians(
        means=np.zeros((count, 3), np.float32),
        scales=np.full((count, 3), 0.01, np.float32),
        quaternions=np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
        opacities=np.full(count, 0.9, np.float32),
        colors=np.full((count, 3), 0.3, np.float32),
        volumes=np.full(count, 1e-6, np.float32),
    )
    topology = replace(
        case.topology,
        binding_index=np.zeros((count, 4), np.int32),
        binding_weight=np.full((count, 4), 0.25, np.float32),
    )
    camera = Camera(np.diag([500.0, 500.0, 1.0]), np.eye(4), 640, 480)
    points = case.observation.points.copy()
    points[2, 3] = np.nan
    observation = replace(case.observation, points=points, colors=np.full((40, 3), 200, np.uint8))
    return replace(case, gaussians=gaussians, topology=topology, camera=camera, observation=observation)


def assert_same(found, expected):
    if is_dataclass(expected):
        assert type(found) is type(expected)
        for one in fields(expected):
            assert_same(getattr(found, one.name), getattr(expected, one.name))
    elif isinstance(expected, np.ndarray):
        assert found.dtype == expected.dtype
        np.testing.assert_array_equal(found, expected)
    elif isinstance(expected, tuple) and expected and is_dataclass(expected[0]):
        for a, b in zip(found, expected, strict=True):
            assert_same(a, b)
    else:
        assert found == expected


def test_a_case_comes_back_as_it_was(full_case, tmp_path):
    save_case(full_case, tmp_path / "a.case.npz")
    assert_same(load_case(tmp_path / "a.case.npz"), full_case)


def test_what_a_case_lacks_stays_lacking(make_case, tmp_path):
    bare = replace(make_case(frames=4), complete=None, truth=None)
    save_case(bare, tmp_path / "a.case.npz")
    assert_same(load_case(tmp_path / "a.case.npz"), bare)


def test_equal_cases_give_equal_bytes(full_case, tmp_path):
    for name in "ab":
        save_case(full_case, tmp_path / f"{name}.case.npz")
    assert (tmp_path / "a.case.npz").read_bytes() == (tmp_path / "b.case.npz").read_bytes()


def test_numpy_reads_the_arrays(full_case, tmp_path):
    save_case(full_case, tmp_path / "a.case.npz")
    with np.load(tmp_path / "a.case.npz", allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["topology.springs"], full_case.topology.springs)


def rewritten(source, target, change):
    with zipfile.ZipFile(source) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    change(members)
    write_archive(target, members)
    return target


def test_files_that_are_no_cases_are_refused_in_one_line(full_case, tmp_path):
    save_case(full_case, tmp_path / "a.case.npz")

    def edited(**new):
        def change(members):
            text = json.loads(members["case.json"])
            members["case.json"] = json.dumps({**text, **new}).encode()

        return rewritten(tmp_path / "a.case.npz", tmp_path / "b.case.npz", change)

    with pytest.raises(InputError, match=r"b\.case\.npz: case\.json: interaction"):
        load_case(edited(interaction="juggle"))
    with pytest.raises(InputError, match=r"split 99 of 5 frames"):
        load_case(edited(split=99))
    lost = rewritten(tmp_path / "a.case.npz", tmp_path / "c.case.npz", lambda m: m.pop("topology.mass.npy"))
    with pytest.raises(InputError, match=r"c\.case\.npz: expected the array topology\.mass"):
        load_case(lost)
    no_text = rewritten(tmp_path / "a.case.npz", tmp_path / "d.case.npz", lambda m: m.pop("case.json"))
    with pytest.raises(InputError, match=r"d\.case\.npz: expected a case"):
        load_case(no_text)


def test_springs_that_join_nothing_are_refused(full_case, tmp_path):
    springs = full_case.topology.springs.copy()
    springs[3, 1] = 10_000
    save_case(
        replace(full_case, topology=replace(full_case.topology, springs=springs)), tmp_path / "a.case.npz"
    )
    with pytest.raises(InputError, match=r"topology\.springs: expected indices below 72, found 0 to 10000"):
        load_case(tmp_path / "a.case.npz")


def test_a_folder_is_read_by_its_index_and_changed_files_are_found(make_case, tmp_path):
    for seed in (1, 0):
        case = make_case(seed=seed, frames=4)
        save_case(case, tmp_path / f"{case.name}.case.npz")
    index = write_index(tmp_path, seed=5)
    assert [entry.object_name for entry in index.cases] == ["bar-0", "bar-1"]
    assert describe(tmp_path) == index
    assert [case.name for case in load_folder(tmp_path)] == ["bar-0-lift", "bar-1-lift"]

    changed = tmp_path / "bar-1-lift.case.npz"
    save_case(make_case(seed=2, frames=4), changed)
    with pytest.raises(InputError, match=r"bar-1-lift\.case\.npz: its bytes are not those"):
        read_index(tmp_path)
    assert len(read_index(tmp_path, verify=False)) == 2
    changed.unlink()
    with pytest.raises(InputError, match=r"bar-1-lift\.case\.npz is missing"):
        read_index(tmp_path, verify=False)


def test_a_folder_without_an_index_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"index\.json: cannot be read"):
        load_folder(tmp_path)
    (tmp_path / INDEX).write_text('{"schema": "other"}')
    with pytest.raises(InputError, match=r"index\.json: schema"):
        load_folder(tmp_path)
