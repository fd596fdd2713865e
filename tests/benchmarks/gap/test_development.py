"""Which worlds a benchmark of healthy ones is about."""

import json

import pytest

from benchmarks.gap.development import healthy_worlds


def test_healthy_worlds_of_open_labels_alone(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("torch.set_num_threads", lambda count: None)  # of this process, which has other tests
    with pytest.raises(SystemExit) as ended:
        healthy_worlds("Of what.", [str(tmp_path)])
    assert ended.value.code == 2
    assert "has no open labels (labels.json): it asks of development worlds alone" in capsys.readouterr().err
    rest = {"effects": [], "accepted": []}
    drawn = (("a", "null", "rope"), ("b", "single", "rope"), ("c", "null", "sheet"))
    labels = [{"world": name, "category": what, "kind": kind, **rest} for name, what, kind in drawn]
    first, second = tmp_path / "first", tmp_path / "second"
    for folder in (first, second):
        folder.mkdir()
        (folder / "labels.json").write_text(json.dumps(labels))
    healthy = healthy_worlds("Of what.", [str(first), str(second)])
    assert [(folder, label["world"]) for folder, label in healthy] == [
        (folder, name) for folder in (first, second) for name in ("a", "c")
    ]
    ropes = healthy_worlds("Of what.", [str(first), "--kind", "rope"])
    assert [label["world"] for _, label in ropes] == ["a"]
    with pytest.raises(SystemExit):
        healthy_worlds("Of what.", [str(first), "--kind", "cloud"])
