"""What a rollout costs with each effect."""

from benchmarks.gap.effect_costs import main
from model.observation import write_observation


def test_every_effect_that_can_act_has_a_row(tilted, tmp_path, capsys):
    """A rope that hangs, without a ground: nothing sticks or rubs there."""
    write_observation(tmp_path / "rope.npz", tilted((3.0, 2.0)))
    main([str(tmp_path / "rope.npz")])
    rows = [line.split("|")[1:-1] for line in capsys.readouterr().out.splitlines()[2:]]
    names = [row[0].strip() for row in rows]
    assert names[0] == "plain"
    assert {"damage", "wind", "grip_slip"} <= set(names)
    assert not {"adhesion", "static_friction"} & set(names)
    assert float(rows[0][3]) == 1.0
    assert all(float(row[1]) >= 0.0 and int(row[2]) > 0 for row in rows)
