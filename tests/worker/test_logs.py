import json
import logging
import sys

from worker.logs import JsonFormatter, relay


def formatted(formatter, **fields):
    record = logging.LogRecord("matphys.job", logging.WARNING, "f", 1, "stage %s", ("x",), None)
    for name, value in fields.items():
        setattr(record, name, value)
    return json.loads(formatter.format(record))


def test_a_line_is_json_with_the_worker_and_the_job():
    line = formatted(JsonFormatter("w", "j", 2), stage="video", seconds=1.5, secret="no")
    assert line.pop("at").endswith("Z")
    assert line == {
        "level": "warning",
        "logger": "matphys.job",
        "message": "stage x",
        "worker": "w",
        "job": "j",
        "attempt": 2,
        "stage": "video",
        "seconds": 1.5,
    }
    assert "job" not in formatted(JsonFormatter("w"))


def test_a_traceback_is_one_line_too():
    try:
        raise ValueError("one\ntwo")
    except ValueError:
        record = logging.LogRecord("m", logging.ERROR, "f", 1, "m", (), sys.exc_info())
    text = JsonFormatter("w").format(record)
    assert "\n" not in text
    assert "ValueError: one\ntwo" in json.loads(text)["traceback"]


def test_what_is_a_log_line_is_passed_on_and_the_rest_becomes_one(capsys, caplog):
    relay('{"at": "x"}', "j", 1)
    relay("Segmentation fault\n", "j", 1)
    relay("\n", "j", 1)
    assert capsys.readouterr().err == '{"at": "x"}\n'
    assert [(each.getMessage(), each.job) for each in caplog.records] == [("Segmentation fault", "j")]
