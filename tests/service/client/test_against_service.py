"""The client against a running front; the test does what a worker does."""

import threading
import time

import pytest

from service.client import Client, DiagnosisRequest, ServiceError, TwinRequest
from worker.record import JobError

FILES = {"bundle.twin.zip": b"PK" + bytes(200_000), "summary.json": b"{}"}


@pytest.fixture
def real(serving):
    with Client(serving.url, serving.keys.create("me", "default", ("submit", "read"))[1]) as client:
        yield client


@pytest.fixture
def clip_file(tmp_path, clip):
    path = tmp_path / "clip.mp4"
    path.write_bytes(clip)
    return path


def later(seconds, work):
    thread = threading.Timer(seconds, work)
    thread.start()
    return thread


def test_a_twin_from_the_clip_to_the_export(real, serving, clip_file, tmp_path):
    twin = real.submit(clip_file, TwinRequest(size_m=0.25, box=(1, 2, 30, 40)))
    assert twin.job.status == "queued"
    assert twin.job.options["size_m"] == 0.25
    assert twin.job.options["box"] == [1, 2, 30, 40]
    assert real.submit(clip_file, TwinRequest(size_m=0.25, box=(1, 2, 30, 40))).id == twin.id
    seen = []
    worker = later(0.3, lambda: serving.finish(twin.id, FILES, tmp_path))
    job = twin.wait(lambda job: seen.append((job.status, job.stage)), timeout_s=30)
    worker.join()
    assert seen[0] == ("queued", None)
    assert ("running", "simulation") in seen
    assert seen[-1][0] == job.status == "succeeded"
    path = twin.download("bundle.twin.zip", tmp_path / "mine.twin.zip")
    assert path.read_bytes() == FILES["bundle.twin.zip"]

    def make_export():
        while not (made := serving.records.children(twin.id)):
            time.sleep(0.02)
        serving.finish(made[0].id, {"twin.ply": b"ply"}, tmp_path)

    worker = later(0.0, make_export)
    assert twin.export("ply", tmp_path / "mine.ply").read_bytes() == b"ply"
    worker.join()
    assert [each.id for each in real.twins("succeeded")] == [twin.id]
    assert twin.logs() == ""
    twin.delete()
    twin.delete()
    assert list(real.twins()) == []


def test_why_a_twin_failed_is_an_error(real, serving, clip_file):
    twin = real.submit(clip_file)
    attempt = serving.records.begin(twin.id, "token", "worker")
    error = JobError(type="bad-input", title="The input cannot be used", detail="nothing moves")
    serving.records.fail(twin.id, attempt, error)
    with pytest.raises(ServiceError, match="nothing moves") as raised:
        twin.wait()
    assert raised.value.type == "urn:matphys:problem:bad-input"
    assert raised.value.job_id == twin.id


def test_a_canceled_twin_ends_the_wait(real, clip_file):
    twin = real.submit(clip_file)
    canceling = later(0.3, real.twin(twin.id).cancel)
    with pytest.raises(ServiceError, match="canceled"):
        twin.wait(timeout_s=30)
    canceling.join()


def test_refusals_carry_what_the_service_said(real, serving, tmp_path, clip_file):
    broken = tmp_path / "broken.mp4"
    broken.write_bytes(b"no picture")
    with pytest.raises(ServiceError) as raised:
        real.submit(broken)
    assert raised.value.status == 415
    assert raised.value.instance.startswith("urn:uuid:")
    with pytest.raises(ServiceError, match="mask"):
        real.submit(clip_file, files={"mask": broken})
    with pytest.raises(ServiceError, match="not done yet") as raised:
        real.submit(clip_file).export("ply", tmp_path / "x")
    assert raised.value.status == 409
    with Client(serving.url, "mp_nonsense") as stranger, pytest.raises(ServiceError) as raised:
        stranger.twin("0" * 32)
    assert raised.value.status == 401


def test_a_key_used_for_other_content_is_refused(real, clip_file, tmp_path, clip):
    other = tmp_path / "other.mp4"
    other.write_bytes(clip + b"\0\0\0\x08free")
    real.submit(clip_file, idempotency_key="mine")
    assert real.submit(clip_file, idempotency_key="mine").job.status == "queued"
    with pytest.raises(ServiceError, match="Idempotency-Key"):
        real.submit(other, idempotency_key="mine")


def test_what_is_too_many_is_waited_for(serve, clip_file, tmp_path, clip):
    serving = serve(max_jobs_per_tenant=1)
    key = serving.keys.create("me", "default", ("submit", "read"))[1]
    other = tmp_path / "other.mp4"
    other.write_bytes(clip + b"\0\0\0\x08free")
    with Client(serving.url, key, patience_s=5) as client:
        client.submit(clip_file)
        started = time.monotonic()
        with pytest.raises(ServiceError) as raised:
            client.submit(other)
        assert raised.value.status == 429
        assert raised.value.retry_after > 5
        assert time.monotonic() - started < 5


@pytest.fixture
def done(real, serving, clip_file, tmp_path):
    twin = real.submit(clip_file)
    serving.finish(twin.id, FILES, tmp_path)
    return real.twin(twin.id)


def test_a_diagnosis_from_the_observation_to_the_report(done, serving, observation, tmp_path, gap_report):
    (tmp_path / "seen.npz").write_bytes(observation)
    diagnosis = done.diagnose(
        tmp_path / "seen.npz", transfer=tmp_path / "seen.npz", request=DiagnosisRequest(tracking="opencv")
    )
    assert diagnosis.job.parent == done.id
    assert set(serving.records.get(diagnosis.id).inputs) == {"observation", "transfer"}
    with pytest.raises(ServiceError, match="There is no such file"):
        diagnosis.report()
    worker = later(0.3, lambda: serving.finish(diagnosis.id, {"report.json": gap_report}, tmp_path))
    diagnosis.wait(timeout_s=30)
    worker.join()
    assert diagnosis.report().verdict.effect == "none"
    assert [each.id for each in done.diagnoses()] == [diagnosis.id]


def test_a_clip_is_sent_as_one(done, serving, clip_file):
    assert set(serving.records.get(done.diagnose(clip_file).id).inputs) == {"video"}
