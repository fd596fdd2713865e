import pytest

from model.gap.benchmark.outcomes import outcomes
from model.gap.benchmark.predict import Prediction
from model.gap.benchmark.scores import Score
from model.gap.benchmark.table import Bars, Row, nearest, table


def rows_of(pairs):
    made = table(outcomes({label["world"]: what for what, label in pairs}, [label for _, label in pairs]))
    return made, {f"{row.name} | {row.of}": row.score for row in made.rows}


def find(scores, start):
    return next(score for name, score in scores.items() if name.startswith(start))


def test_every_score_counts_its_own_worlds(said, label_of):
    moved = {"refit": 0.01, "with_effect": 0.004, "noise_floor": 0.002, "closed_fraction": 0.75}
    pairs = [
        (said("wind", transfer=moved), label_of("a", "wind")),
        (said("damage"), label_of("b", "wind", magnitude=2.5)),
        (said("none"), label_of("c", "wind", magnitude=0.5)),
        (said("wind", probability=0.4, second="damage"), label_of("d", "damage", "wind")),
        (said("none"), label_of("e")),
        (said("plasticity"), label_of("f")),
        (said("wind"), label_of("g", category="perception", accepted=["none"])),
        (said("unknown"), label_of("h", "magnet", accepted=["unknown"], category="outside")),
        (Prediction(None, "broken"), label_of("i")),
    ]
    made, scores = rows_of(pairs)
    assert find(scores, "top-1").value == pytest.approx(2 / 3), "a, b and d are clear"
    assert find(scores, "top-1, one effect").value == 0.5
    assert find(scores, "top-1, two effects").value == 1.0
    assert find(scores, "both of two").value == 1.0
    assert find(scores, "false alarms | nothing missing").value == pytest.approx(1 / 3), "f of e, f, i"
    assert find(scores, "false alarms | nothing missing, but").value == 1.0
    assert find(scores, "recall of unknown").value == 1.0
    assert find(scores, "gap closed").value == pytest.approx(0.75)
    assert find(scores, "gap closed").count == 1
    assert find(scores, "refused").value == pytest.approx(1 / 9)
    assert find(scores, "ECE | all").count == 8, "who refuses gives no probability"
    assert find(scores, "ECE by chance").count == find(scores, "ECE | no effect").count
    assert [rung.named.count for rung in made.ladder] == [1, 0, 1, 2]
    assert made.ladder[0].noticed.value == 0.0
    assert [row.of for row in made.kinds] == ["rope"]


def test_top_three_looks_at_three_answers(said, label_of):
    # Of the other effects, actuation_delay and adhesion are ranked first by the stand-in.
    near, far = label_of("a", "adhesion"), label_of("b", "wind")
    _, scores = rows_of([(said("damage"), near), (said("damage"), far)])
    assert find(scores, "top-3").value == 0.5


@pytest.mark.parametrize(
    ("value", "bars", "holds"),
    [
        (0.8, Bars(0.75), True),
        (0.7, Bars(0.75), False),
        (0.04, Bars(0.05, smaller=True), True),
        (0.06, Bars(0.05, smaller=True), False),
        (0.9, Bars(0.85, most=0.95), True),
        (0.99, Bars(0.85, most=0.95), False),
        (0.9, Bars(None, 0.4), None),
        (None, Bars(0.75), None),
    ],
)
def test_bars(value, bars, holds):
    assert Row("score", "worlds", Score(value), bars).holds is holds


def test_magnitudes_are_counted_by_the_nearest_step():
    assert [nearest(value) for value in (0.1, 0.7, 0.72, 1.41, 1.42, 3.0, 9.0)] == [0.5, 0.5, 1, 1, 2, 4, 4]
