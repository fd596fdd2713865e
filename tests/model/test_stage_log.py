from dataclasses import dataclass

import pytest

from model.stage_log import StageLog, Step


@dataclass(frozen=True)
class Doubtful:
    warnings: tuple[str, ...]


@pytest.fixture
def said() -> list[tuple[str, float]]:
    return []


@pytest.fixture
def log(said: list[tuple[str, float]]) -> StageLog:
    return StageLog({"first": 1.0, "second": 3.0}, lambda stage, share: said.append((stage, share)))


def test_stages_are_recorded_in_order_and_report_the_share_done(log, said):
    assert log.run("first", Step("a", "1"), lambda: 7) == 7
    log.run("second", Step("b", "2", "hash"), lambda: log.within("second")(0.5))
    assert said == [("first", 0.0), ("second", 0.25), ("second", 0.625)]
    told = [(each.name, each.method, each.version, each.weights) for each in log.records]
    assert told == [("first", "a", "1", None), ("second", "b", "2", "hash")]


def test_what_a_stage_says_too_much_of_is_no_more_than_all(log, said):
    log.run("first", Step("a", "1"), lambda: None)
    log.run("second", Step("b", "1"), lambda: None)
    log.within("second")(2.0)
    assert said[-1] == ("second", 1.0)


def test_seconds_are_measured_but_not_recorded(log, monkeypatch):
    clock = iter([10.0, 12.5])
    monkeypatch.setattr("time.perf_counter", lambda: next(clock))
    log.run("first", Step("a", "1"), lambda: None)
    assert log.seconds == {"first": 2.5}
    assert log.records[0].seconds is None


def test_warnings_name_their_stage_and_are_said_once(log):
    log.run("first", Step("a", "1"), lambda: Doubtful(("dark", "blurred", "dark")))
    log.run("second", Step("b", "1"), lambda: Doubtful(("dark",)))
    assert log.records[0].warnings == ("dark", "blurred", "dark")
    assert log.warnings == ["first: dark", "first: blurred", "second: dark"]


def test_a_stage_that_fails_leaves_no_record(log):
    def fail():
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        log.run("first", Step("a", "1"), fail)
    assert log.records == []
