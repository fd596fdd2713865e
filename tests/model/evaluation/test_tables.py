import csv
import io

import pytest

from model.evaluation.protocol import SETTINGS
from model.evaluation.records import GlobalRecord, PartRecord
from model.evaluation.tables import as_plain, csv_text, markdown, tables


@pytest.fixture
def records(make_record):
    made = []
    for k, name in enumerate("abcdef"):
        parts = [
            PartRecord(part=0, material="fur", log_truth=float(k), log_estimate=float(k), log_spread=0.1)
        ]
        friction = {"friction": GlobalRecord(truth=0.5, estimate=1.0, std=None)}
        made.append(make_record("ours", name, track=0.001 * (k + 1), parts=parts, globals=friction))
        made.append(make_record("theirs", name, track=0.001 * (k + 3)))
    return made


def table_of(made, title):
    return next(table for table in made if table.title.startswith(title))


def test_every_setting_has_its_table_with_intervals(records):
    made = tables(records, ("ours", "theirs"), SETTINGS)
    titles = [table.title for table in made]
    assert titles[:4] == [
        "Reconstruction and resimulation",
        "Future (7:3 in time)",
        "Unseen interaction",
        "Unseen object",
    ]
    text = markdown(table_of(made, "Reconstruction"))
    heads, _, ours, theirs = text.strip().splitlines()[2:]
    assert heads == "| method | CD [mm] | track [mm] | track, matched [mm] | objects | clips | failed |"
    assert ours.startswith("| ours | 1.7 [")
    assert " 3.5 [2.2, 4.7] " in ours
    assert theirs.endswith("| 6 | 6 | 0 |")
    unseen = table_of(made, "Unseen interaction").rows[0][1][1]
    assert (unseen.column, unseen.figure.value) == ("track [mm]", pytest.approx(10.5))


def test_differences_are_paired(records):
    made = tables(records, ("ours", "theirs"), ("future",))
    table = table_of(made, "Worse than ours")
    assert [row[0] for row in table.rows] == ["theirs"]
    track = table.rows[0][1][1]
    assert track.column == "future: track [mm]"
    assert (track.figure.low, track.figure.value, track.figure.high) == pytest.approx((4.0, 4.0, 4.0))


def test_stiffness_is_compared_clip_by_clip(make_record):
    def parts(error):
        return [PartRecord(part=0, material="fur", log_truth=1.0, log_estimate=1.0 + error, log_spread=None)]

    records = [make_record("ours", name, parts=parts(-0.5)) for name in ("a", "b")]
    records += [make_record("theirs", name, parts=parts(0.75)) for name in ("a", "b", "c")]
    cell = table_of(tables(records, ("ours", "theirs"), ("future",)), "Worse than ours").rows[0][1][-2]
    assert cell.column == "parts: error of ln E"
    assert (cell.figure.value, cell.figure.objects) == (pytest.approx(0.25), 2)


def test_objects_that_were_trained_on_are_not_unseen(make_record):
    known = make_record("ours", "a", track=1.0, known_object=True)
    new = make_record("ours", "b", track=0.001)
    made = tables([known, new], ("ours",), SETTINGS)
    assert table_of(made, "Unseen object").rows[0][2] == ("1", "1", "0")
    assert table_of(made, "Unseen object").rows[0][1][1].figure.value == pytest.approx(2.0)
    assert table_of(made, "Future (").rows[0][2] == ("2", "2", "0")


def test_failures_are_counted_where_they_are(make_record):
    record = make_record("ours", "a", failed="broke")
    unseen = [record.unseen[0].model_copy(update={"failed": "broke"}), record.unseen[0]]
    made = tables([record.model_copy(update={"unseen": unseen})], ("ours",), SETTINGS)
    assert table_of(made, "Future (").rows[0][2][-1] == "1"
    assert table_of(made, "Unseen interaction").rows[0][2][-1] == "1"


def test_what_is_not_known_is_a_dash_and_tables_without_figures_are_left_out(records, make_record):
    made = tables(records, ("ours", "theirs"), ("future",))
    stiffness = markdown(table_of(made, "Stiffness"))
    assert "| ours | 1.00 [1.00, 1.00] | 0.00 [0.00, 0.00] |" in stiffness
    assert "| theirs | – | – | – | – | 0 |" in stiffness
    assert "0.69 [0.69, 0.69]" in markdown(table_of(made, "Parameters of the whole"))
    bare = tables([make_record("ours", "a")], ("ours",), ("future",))
    assert not any(table.title.startswith(("Stiffness", "Worse", "Spread")) for table in bare)


def test_a_method_without_records_is_shown_as_such(records):
    made = tables(records, ("ours", "absent"), ("future",))
    assert made[0].rows[1][2] == ("0", "0", "0")


def test_csv_holds_every_figure(records):
    made = tables(records, ("ours", "theirs"), SETTINGS)
    rows = list(csv.DictReader(io.StringIO(csv_text(made))))
    assert len(rows) == len(as_plain(made)) > 20
    first = rows[0]
    assert (first["table"], first["method"], first["column"]) == (
        "Reconstruction and resimulation",
        "ours",
        "CD [mm]",
    )
    assert float(first["value"]) == pytest.approx(1.75)
    assert float(first["low"]) < 1.75 < float(first["high"])
    assert first["objects"] == "6"
