import random

import pytest

from worker import records as module
from worker.record import JobError, JobFile
from worker.records import Fenced, KeyReused, ParentGone, QueueFull, TenantBusy

ERROR = JobError(type="crash", title="t", detail="d")
FILE = JobFile(name="a", bytes=1, sha256="0" * 64, key="jobs/x/1/a")


def begin(records, record, token="token"):
    attempt = records.begin(record.id, token, "worker")
    assert attempt is not None
    return attempt


def test_a_job_goes_from_accepted_to_published(records, errand):
    record = errand(
        options={"seconds": 1.5, "list": [1], "none": None}, inputs={"note": "jobs/n"}, webhook=None
    )
    created, new = records.create(record)
    assert new
    assert created.options == record.options
    assert created.inputs == record.inputs
    assert created.status == "queued"
    attempt = begin(records, record)
    records.advance(record.id, attempt, "walking", 12.5)
    running = records.get(record.id)
    assert (running.status, running.stage, running.progress, running.attempt) == (
        "running",
        "walking",
        12.5,
        1,
    )
    records.succeed(record.id, attempt, [FILE], {"iou": 0.5})
    done = records.get(record.id)
    assert (done.status, done.progress, done.files, done.metrics) == (
        "succeeded",
        100.0,
        (FILE,),
        {"iou": 0.5},
    )
    assert done.file("a") == FILE
    assert done.file("b") is None
    assert created.created_at <= done.started_at <= done.completed_at < done.expires_at
    assert (done.expires_at - done.completed_at).total_seconds() == pytest.approx(record.keep_s)


def test_the_same_key_gives_the_same_job_and_other_content_under_it_is_refused(records, errand):
    first = errand(digest="one")
    assert records.create(first, "key") == (records.get(first.id), True)
    again, new = records.create(errand(digest="one"), "key")
    assert (again.id, new) == (first.id, False)
    with pytest.raises(KeyReused):
        records.create(errand(digest="two"), "key")
    assert records.create(errand("b", digest="two"), "key")[1], "another tenant's keys are its own"


def test_a_key_holds_across_an_upgrade_and_content_alone_does_not(records, errand):
    first = errand(digest="request-1.0")
    records.create(first, "key")
    assert records.create(errand(digest="request-2.0"), "key")[0].id == first.id
    assert records.create(errand(digest="request-2.0"))[1], "new software makes it anew"


def test_a_metric_that_json_cannot_tell_is_not_published(records, errand):
    record = errand()
    records.create(record)
    attempt = begin(records, record)
    with pytest.raises(ValueError, match="JSON"):
        records.succeed(record.id, attempt, [], {"iou": float("nan")})
    assert records.get(record.id).status == "running"


def test_the_same_content_gives_the_same_job_until_it_failed(records, errand):
    first = errand(digest="content")
    records.create(first)
    assert records.create(errand(digest="content"))[0].id == first.id
    assert records.create(errand("b", digest="content"))[1], "tenants do not learn of each other"
    records.fail(first.id, begin(records, first), ERROR)
    second = errand(digest="content")
    assert records.create(second)[1]
    records.succeed(second.id, begin(records, second), [], {})
    assert records.create(errand(digest="content"))[0].id == second.id


def test_a_creation_whose_answer_got_lost_is_repeated(records, errand):
    record = errand(digest="content")
    assert records.create(record, "key")[1]
    assert records.create(record, "key")[1]
    assert records.depth("twins") == 1


def test_queues_and_tenants_have_limits(records, errand):
    records.create(errand(), most_active=1)
    with pytest.raises(TenantBusy):
        records.create(errand(), most_active=1)
    with pytest.raises(QueueFull):
        records.create(errand("b"), most_queued=1)
    assert records.create(errand("b"), most_queued=2, most_active=1)[1]


def test_running_jobs_count_for_the_tenant_and_ended_ones_do_not(records, errand):
    record = errand()
    records.create(record)
    attempt = begin(records, record)
    with pytest.raises(TenantBusy):
        records.create(errand(), most_active=1)
    records.succeed(record.id, attempt, [], {})
    assert records.create(errand(), most_active=1)[1]


def test_one_run_holds_a_job_and_the_same_run_may_ask_twice(records, errand):
    record = errand()
    records.create(record)
    assert records.begin(record.id, "one", "w") == 1
    assert records.begin(record.id, "one", "w") == 1
    assert records.begin(record.id, "two", "w") is None
    assert records.begin("nowhere", "two", "w") is None


def test_only_the_newest_attempt_may_change_a_job(records, errand):
    record = errand()
    records.create(record)
    old = begin(records, record, "old")
    assert records.hand_back(record.id, old) == "queued"
    new = begin(records, record, "new")
    for change in (
        lambda: records.advance(record.id, old, "walking", 1.0),
        lambda: records.succeed(record.id, old, [FILE], {}),
        lambda: records.fail(record.id, old, ERROR),
    ):
        with pytest.raises(Fenced):
            change()
    assert not records.renew(record.id, old)
    assert records.crash(record.id, old, ERROR) is None
    assert records.get(record.id).files == ()
    records.succeed(record.id, new, [FILE], {})
    records.succeed(record.id, new, [FILE], {})  # the answer to the first call was lost


def test_final_states_never_change(records, errand):
    for end in ("succeed", "fail", "cancel"):
        record = errand()
        records.create(record)
        attempt = begin(records, record)
        if end == "succeed":
            records.succeed(record.id, attempt, [FILE], {})
        elif end == "fail":
            records.fail(record.id, attempt, ERROR)
        else:
            assert records.cancel(record.id) == "running"
        before = records.get(record.id)
        assert records.cancel(record.id) == before.status
        assert records.begin(record.id, "again", "w") is None
        assert records.crash(record.id, attempt, ERROR) is None
        assert records.hand_back(record.id, attempt) is None
        with pytest.raises(Fenced):
            records.advance(record.id, attempt, "walking", 0.0)
        assert records.get(record.id) == before


def test_crashes_are_forgiven_twice_and_hand_backs_always(records, errand, monkeypatch, eventually):
    record = errand()
    records.create(record)
    for _ in range(5):
        assert records.hand_back(record.id, begin(records, record)) == "queued"
    assert records.crash(record.id, begin(records, record), ERROR) == "queued"
    assert records.begin(record.id, "early", "w") is None, "it waits a moment first"
    eventually(lambda: records.due("twins"))
    assert records.crash(record.id, begin(records, record), ERROR) == "queued"
    eventually(lambda: records.due("twins"))
    assert records.crash(record.id, begin(records, record), ERROR) == "failed"
    failed = records.get(record.id)
    assert (failed.status, failed.error, failed.crashes, failed.attempt) == ("failed", ERROR, 3, 8)
    assert failed.postponed == 0, "nothing was done that asked for more"


def test_a_silent_worker_is_suspected_first_and_loses_its_job_then(records, errand, monkeypatch, eventually):
    monkeypatch.setattr(module, "LEASE_S", 0.05)
    monkeypatch.setattr(module, "GRACE_S", 0.05)
    record = errand()
    records.create(record)
    attempt = begin(records, record)
    assert records.reap(ERROR) == {}
    eventually(lambda: records.reap(ERROR) == {record.id: "queued"})
    assert not records.renew(record.id, attempt)


def test_a_suspected_worker_that_speaks_up_keeps_its_job(records, client, errand, monkeypatch):
    record = errand()
    records.create(record)
    monkeypatch.setattr(module, "LEASE_S", 0.0)
    monkeypatch.setattr(module, "GRACE_S", 0.0)
    attempt = begin(records, record)
    assert records.reap(ERROR) == {}
    assert client.hexists(f"matphys:job:{record.id}", "suspect")
    monkeypatch.setattr(module, "LEASE_S", 10.0)
    assert records.renew(record.id, attempt)
    assert records.reap(ERROR) == {}
    assert not client.hexists(f"matphys:job:{record.id}", "suspect")


def test_lists_go_from_new_to_old_in_pages_and_by_status(records, errand):
    made = [errand() for _ in range(7)]
    for record in made:
        records.create(record)
    records.create(errand("b"))
    records.cancel(made[2].id)
    newest_first = [record.id for record in reversed(made)]
    page, cursor = records.list("a", "errand", limit=4)
    rest, end = records.list("a", "errand", cursor=cursor, limit=4)
    assert [record.id for record in (*page, *rest)] == newest_first
    assert end is None
    canceled, _ = records.list("a", "errand", status="canceled")
    assert [record.id for record in canceled] == [made[2].id]
    assert records.list("a", "twin") == ([], None)


def test_a_page_that_is_just_full_has_no_next_one(records, errand):
    records.create(errand())
    assert records.list("a", "errand", limit=1)[1] is None


def test_positions_count_the_jobs_before(records, errand):
    made = [errand() for _ in range(3)]
    for record in made:
        records.create(record)
    assert [records.position(record) for record in made] == [0, 1, 2]
    begin(records, made[0])
    assert [records.position(record) for record in made] == [None, 0, 1]
    assert (records.depth("twins"), records.running()) == (2, 1)


def test_deleting_takes_children_and_leaves_the_files_to_the_sweep(records, client, errand):
    parent = errand(digest="content")
    records.create(parent, "key")
    child = errand(parent=parent.id)
    records.create(child)
    begin(records, parent)
    assert [each.id for each in records.children(parent.id)] == [child.id]
    records.delete(parent.id)
    records.delete(parent.id)
    assert records.get(parent.id) is None
    assert records.get(child.id) is None
    kept = {key for key in client.keys("matphys:*") if not key.startswith("matphys:idempotency")}
    assert kept == {"matphys:garbage", "matphys:outcomes", "matphys:stages"}
    assert set(client.zrange("matphys:garbage", 0, -1)) == {f"jobs/{parent.id}/", f"jobs/{child.id}/"}
    assert records.create(errand(digest="content"), "key")[1], "neither key nor content are known any more"


def test_jobs_whose_time_is_over_are_deleted(records, errand, eventually):
    record = errand(keep_s=1.0)
    records.create(record)
    records.succeed(record.id, begin(records, record), [FILE], {})
    assert records.expire() == 0
    eventually(lambda: records.expire() == 1)
    assert records.get(record.id) is None
    assert records.expire() == 0


def test_a_job_is_kept_as_long_as_what_is_made_of_it(records, client, errand, eventually):
    """Neither a diagnosis under way nor one that has ended goes with a twin that is older."""
    parent = errand(keep_s=1.0)
    records.create(parent)
    records.succeed(parent.id, begin(records, parent), [FILE], {})
    short = records.get(parent.id).expires_at
    child = errand(parent=parent.id, keep_s=600.0)
    records.create(child)
    assert records.get(parent.id).expires_at > short
    attempt = begin(records, child)
    eventually(lambda: records._now() > short.timestamp())
    assert records.expire() == 0
    records.succeed(child.id, attempt, [FILE], {})
    assert records.get(parent.id).expires_at >= records.get(child.id).expires_at
    assert records.expire() == 0
    assert records.get(child.id).status == "succeeded"


def test_who_is_given_a_known_job_is_promised_it_for_as_long(records, client, errand):
    """It was accepted again: it does not go a moment later."""
    parent = errand(keep_s=1.0)
    records.create(parent)
    records.succeed(parent.id, begin(records, parent), [FILE], {})
    child = errand(parent=parent.id, keep_s=60.0, digest="content")
    records.create(child, "key")
    records.succeed(child.id, begin(records, child), [FILE], {})
    for again, key in ((errand(parent=parent.id, keep_s=600.0, digest="content"), ""), (child, "key")):
        known, new = records.create(again.model_copy(update={"id": errand().id, "keep_s": 600.0}), key)
        assert (known.id, new) == (child.id, False)
        assert (known.expires_at - known.completed_at).total_seconds() > 590
    assert records.get(parent.id).expires_at > records.get(parent.id).completed_at


def test_no_job_is_made_of_what_was_deleted_meanwhile(records, client, errand):
    parent = errand()
    records.create(parent)
    records.delete(parent.id)
    with pytest.raises(ParentGone):
        records.create(errand(parent=parent.id))
    assert records.depth("twins") == 0


@pytest.mark.parametrize("begun", [False, True])
def test_what_is_being_made_of_a_job_keeps_it_however_long_that_takes(records, client, errand, begun):
    parent, child = errand(keep_s=1.0), None
    records.create(parent)
    records.succeed(parent.id, begin(records, parent), [FILE], {})
    child = errand(parent=parent.id, keep_s=1.0)
    records.create(child)
    attempt = begin(records, child) if begun else None
    client.zadd("matphys:expiry", {parent.id: 1.0})
    assert records.expire() == 0
    assert records.get(parent.id) is not None
    assert records.get(child.id).status == ("running" if begun else "queued")
    records.fail(child.id, attempt or begin(records, child), ERROR)
    client.zadd("matphys:expiry", {parent.id: 1.0})
    assert records.expire() == 1
    assert records.get(parent.id) is records.get(child.id) is None


def test_reserved_files_are_swept_unless_a_job_claims_them(records, client, errand):
    claimed, orphan = errand(), errand()
    records.reserve(claimed.id)
    records.reserve(orphan.id)
    records.create(claimed)
    assert client.zrange("matphys:garbage", 0, -1) == [f"jobs/{orphan.id}/"]
    assert records.garbage() == []
    client.zadd("matphys:garbage", {f"jobs/{orphan.id}/": 0})
    assert records.garbage() == [f"jobs/{orphan.id}/"]
    records.swept(f"jobs/{orphan.id}/")
    assert records.garbage() == []


def test_the_files_of_an_attempt_without_result_are_garbage(records, client, errand):
    record = errand()
    records.create(record)
    records.hand_back(record.id, begin(records, record))
    records.fail(record.id, begin(records, record), ERROR)
    assert client.zrange("matphys:garbage", 0, -1) == [f"jobs/{record.id}/1/", f"jobs/{record.id}/2/"]


def test_the_end_makes_a_webhook_once(records, errand):
    record = errand(webhook="https://example.org")
    records.create(record)
    attempt = begin(records, record)
    records.succeed(record.id, attempt, [], {})
    records.succeed(record.id, attempt, [], {})
    (hook,) = records.children(record.id)
    assert (hook.kind, hook.queue, hook.status, hook.parent) == ("webhook", "webhooks", "queued", record.id)
    assert records.due("webhooks") == [hook.id]
    records.succeed(hook.id, begin(records, hook), [], {})
    assert records.children(hook.id) == []


@pytest.mark.parametrize("seed", range(5))
def test_whatever_happens_in_whatever_order_nothing_is_published_twice(
    records, progress, errand, monkeypatch, seed
):
    """Many runs at a few jobs, each doing at random what runs, users and janitors do."""
    monkeypatch.setattr(module, "LEASE_S", 0.0)
    monkeypatch.setattr(module, "GRACE_S", 0.0)
    lot = random.Random(seed)
    made = [errand() for _ in range(4)]
    for record in made:
        records.create(record)
    held, published = [], []

    def succeed(job_id, attempt):
        records.succeed(job_id, attempt, [FILE], {"attempt": attempt})
        published.append((job_id, attempt))

    for step in range(150):
        job_id = lot.choice(made).id
        attempt = records.begin(job_id, f"token-{step}", "w")
        if attempt is not None:
            held.append((job_id, attempt))
        if lot.random() < 0.3:
            records.reap(ERROR)
        if lot.random() < 0.02:
            records.cancel(job_id)
        if held:
            change = lot.choice([records.hand_back, records.hand_back, records.hand_back, succeed])
            try:
                change(*lot.choice(held))
            except Fenced:
                continue
    finals = {record.id: records.get(record.id) for record in made}
    for job_id, attempt in published:
        assert finals[job_id].status == "succeeded"
        assert finals[job_id].metrics == {"attempt": attempt}
    for record in finals.values():
        assert sum(event.final for event in progress.read(record.id)) == int(record.final)
    assert published
