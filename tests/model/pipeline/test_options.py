import json

from model.pipeline.options import TwinOptions, fingerprint


def test_files_count_by_their_content_wherever_they_are(tmp_path):
    for name, content in (("a.png", b"same"), ("b.png", b"same"), ("c.png", b"other")):
        (tmp_path / name).write_bytes(content)
    one, two, other = (fingerprint(TwinOptions(mask=tmp_path / f"{name}.png")) for name in "abc")
    assert one == two
    assert one["mask"] != other["mask"]


def test_a_folder_counts_by_all_that_is_in_it(tmp_path):
    (tmp_path / "deep").mkdir()
    (tmp_path / "a.png").write_bytes(b"one")
    before = fingerprint(TwinOptions(depth=tmp_path))
    (tmp_path / "deep" / "b.png").write_bytes(b"two")
    assert len(before["depth"]) == 1
    assert len(fingerprint(TwinOptions(depth=tmp_path))["depth"]) == 2


def test_a_predictor_of_a_file_counts_by_its_weights():
    one, two = (fingerprint(TwinOptions(predictor=f"{name}.safetensors"), "a1b2") for name in "ab")
    assert one == two
    assert one != fingerprint(TwinOptions(predictor="a.safetensors"), "c3d4")
    assert fingerprint(TwinOptions())["predictor"] == "matphys"


def test_it_says_every_option_as_json():
    said = fingerprint(TwinOptions(box=(1, 2, 3, 4)))
    assert json.loads(json.dumps(said)) == said
    assert said["box"] == [1, 2, 3, 4]
    assert said["mesh"] is None
    assert said["parts"] == 5
