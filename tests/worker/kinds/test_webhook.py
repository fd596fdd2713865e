import json
from dataclasses import dataclass, field
from datetime import UTC, datetime

import pytest

from model.errors import InputError
from worker.kinds import Outcome, OutOfTimeError, Postponed
from worker.kinds.webhook import PAUSES_S, WebhookKind, message
from worker.record import JobError, JobRecord
from worker.webhooks import Undelivered


@dataclass
class Told:
    """What the kind asks of a run."""

    parent: JobRecord | None
    attempt: int = 1
    record: JobRecord = field(
        default_factory=lambda: JobRecord(id="1-webhook", kind="webhook", queue="webhooks", tenant="a")
    )
    problem: BaseException | None = None
    sent: list[tuple[str, str, bytes]] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)

    def send(self, url, message_id, body):
        self.sent.append((url, message_id, body))
        if self.problem:
            raise self.problem

    def log(self, line):
        self.lines.append(line)


@pytest.fixture
def ended() -> JobRecord:
    return JobRecord(
        id="1",
        kind="twin",
        queue="twins",
        tenant="a",
        status="failed",
        webhook="https://example.org/hook",
        completed_at=datetime(2026, 11, 21, 12, 0, 0, tzinfo=UTC),
        error=JobError(type="bad-input", title="t", detail="d"),
    )


def test_what_is_told(ended):
    told = json.loads(message(ended))
    assert told == {
        "type": "twin.failed",
        "timestamp": "2026-11-21T12:00:00Z",
        "data": {
            "id": "1",
            "kind": "twin",
            "status": "failed",
            "parent": None,
            "error": {"type": "urn:matphys:problem:bad-input", "title": "t", "detail": "d"},
        },
    }


def test_it_goes_to_the_url_of_the_job_under_an_id_that_stays(ended):
    run = Told(ended)
    assert WebhookKind().run(run) == Outcome()
    assert run.sent == [("https://example.org/hook", "1-webhook", message(ended))]


def test_it_is_tried_again_later_and_later_and_then_given_up(ended):
    pauses = []
    first = Told(ended).record

    def told(postponed):
        record = first.model_copy(update={"postponed": postponed})
        # nine attempts more, in which a full disk let nothing begin, are no tries
        return Told(ended, postponed + 10, record, Undelivered("the answer was 500"))

    for number in range(len(PAUSES_S)):
        with pytest.raises(Postponed) as postponed:
            WebhookKind().run(told(number))
        pauses.append(postponed.value.seconds)
    assert pauses == sorted(PAUSES_S)
    with pytest.raises(InputError, match="gave up after 8 tries: the answer was 500"):
        WebhookKind().run(told(len(PAUSES_S)))


def test_a_receiver_that_drips_until_the_time_is_over_is_tried_again(ended):
    run = Told(ended, problem=OutOfTimeError())
    with pytest.raises(Postponed):
        WebhookKind().run(run)
    assert run.lines == ["webhook: try 1: the answer took too long"]


def test_nobody_is_told_of_a_job_that_is_gone(ended):
    for parent in (None, ended.model_copy(update={"webhook": None})):
        run = Told(parent)
        WebhookKind().run(run)
        assert run.sent == []
