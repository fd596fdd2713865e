from datetime import UTC, datetime

from worker.record import JobRecord, files_prefix, from_fields, new_id, to_fields


def test_ids_are_keys_of_the_store_sorted_by_time():
    ids = [new_id() for _ in range(100)]
    assert ids == sorted(ids)
    assert len(set(ids)) == 100
    assert all(len(each) == 32 and int(each, 16) for each in ids)
    assert files_prefix(ids[0]) == f"jobs/{ids[0]}/"


def test_what_a_new_job_brings_comes_back():
    record = JobRecord(
        id="1",
        kind="errand",
        queue="twins",
        tenant="ä",
        parent="0",
        options={"a": [1, None, {"b": "ü"}], "c": 0.1},
        inputs={"note": "jobs/1/input/note"},
        webhook="https://example.org",
        digest="d",
        keep_s=1.5,
    )
    fields = list(to_fields(record))
    assert from_fields(dict(zip(fields[::2], fields[1::2], strict=True))) == record


def test_times_are_utc():
    fields = {"id": "1", "kind": "k", "queue": "q", "tenant": "t", "created_at": "0.25"}
    assert from_fields(fields).created_at == datetime(1970, 1, 1, 0, 0, 0, 250_000, UTC)


def test_an_empty_hash_is_no_job():
    assert from_fields({}) is None
