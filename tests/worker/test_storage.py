import os
import shutil
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress
from hashlib import sha256

import httpx
import pytest
from moto.server import ThreadedMotoServer

from model.errors import InputError
from worker import storage
from worker.storage import Exists, Storage, StorageError

CONTENT = os.urandom(2_500_000)
PUBLISH = """
import sys
from pathlib import Path
from threading import Thread
from worker.storage import Storage

def anonymous():
    return int(next(line for line in open("/proc/self/status") if line.startswith("RssAnon")).split()[1])

small = Path(sys.argv[2]).with_name("small")
small.write_bytes(b"a")
store = Storage(sys.argv[1])
store.publish("jobs/a/1/small", small)
before = most = anonymous()
work = Thread(target=store.publish, args=("jobs/a/1/x", Path(sys.argv[2])))
work.start()
while work.is_alive():
    most = max(most, anonymous())
print(most - before)
"""
"""Says how much memory [kB] is needed beyond that of a small file, as the kernel counts what is no file's."""


@contextmanager
def slow_bucket(bytes_per_second):
    """Takes what is put, at a pace, and answers that it has."""
    listener = socket.create_server(("127.0.0.1", 0))
    threading.Thread(target=_take, args=(listener, bytes_per_second), daemon=True).start()
    yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    listener.close()


def _take(listener, bytes_per_second):
    while True:
        try:
            connection, _ = listener.accept()
        except OSError:
            return
        with connection, suppress(OSError):
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65536)
            head, _, body = connection.recv(65536).partition(b"\r\n\r\n")
            lines = [line.partition(b":") for line in head.lower().split(b"\r\n")]
            missing = next(int(size) for name, _, size in lines if name == b"content-length") - len(body)
            while missing > 0:
                piece = connection.recv(65536)
                if not piece:
                    break
                missing -= len(piece)
                time.sleep(len(piece) / bytes_per_second)
            connection.sendall(b'HTTP/1.1 200 OK\r\nETag: "x"\r\nContent-Length: 0\r\n\r\n')


@pytest.fixture(scope="session")
def bucket():
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    httpx.put(f"http://{host}:{port}/twins").raise_for_status()
    yield f"http://{host}:{port}"
    server.stop()


@pytest.fixture(params=["file", "s3"])
def store(request, tmp_path, monkeypatch):
    if request.param == "file":
        return Storage(f"file://{tmp_path}/store")
    monkeypatch.setenv("AWS_ENDPOINT_URL", request.getfixturevalue("bucket"))
    for name, value in {"ACCESS_KEY_ID": "k", "SECRET_ACCESS_KEY": "s", "REGION": "us-east-1"}.items():
        monkeypatch.setenv(f"AWS_{name}", value)
    return Storage(f"s3://twins/{tmp_path.name}")


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "source"
    path.write_bytes(CONTENT)
    return path


def test_what_is_published_comes_back(store, source, tmp_path):
    file = store.publish("jobs/a/1/twin.zip", source)
    assert (file.name, file.bytes, file.key) == ("twin.zip", len(CONTENT), "jobs/a/1/twin.zip")
    assert file.sha256 == sha256(CONTENT).hexdigest()
    assert store.size(file.key) == len(CONTENT)
    assert b"".join(store.stream(file.key)) == CONTENT
    store.fetch(file.key, tmp_path / "copy")
    assert (tmp_path / "copy").read_bytes() == CONTENT


@pytest.mark.parametrize(
    ("start", "end"), [(0, 10), (5, 2_000_000), (2_499_999, None), (2_499_000, 9_999_999), (7, 7)]
)
def test_parts_come_back(store, source, start, end):
    store.publish("jobs/a/1/twin.zip", source)
    assert b"".join(store.stream("jobs/a/1/twin.zip", start, end)) == CONTENT[start:end]


def test_nothing_can_be_stored_too(store, tmp_path):
    (tmp_path / "empty").touch()
    assert store.publish("jobs/a/1/log", tmp_path / "empty").bytes == 0
    assert b"".join(store.stream("jobs/a/1/log")) == b""


def test_a_reader_may_be_slow(store, source, monkeypatch, tmp_path):
    """Slower than a bucket may be: what is read is asked for piece by piece."""
    store.publish("jobs/a/1/twin.zip", source)
    monkeypatch.setattr(storage, "SILENCE_S", 0.3)
    patient = Storage(f"s3://twins/{tmp_path.name}") if store._folder is None else store
    read = []
    for piece in patient.stream("jobs/a/1/twin.zip"):
        read.append(piece)
        time.sleep(0.2)
    assert b"".join(read) == CONTENT


def test_a_large_file_may_take_its_time_to_a_bucket(tmp_path, monkeypatch):
    """Longer than small ones may: the line to it is what it is."""
    path = tmp_path / "large"
    path.write_bytes(bytes(3_000_000))
    with slow_bucket(bytes_per_second=3_000_000) as address:
        for name, value in {"ENDPOINT_URL": address, "ACCESS_KEY_ID": "k", "SECRET_ACCESS_KEY": "s"}.items():
            monkeypatch.setenv(f"AWS_{name}", value)
        monkeypatch.setattr(storage, "SILENCE_S", 0.5)
        with pytest.raises(StorageError):
            Storage("s3://twins/x", patience_s=0.1).publish("jobs/a/1/x", path)
        monkeypatch.setattr(storage, "SMALL", 1_000_000)
        assert Storage("s3://twins/x", patience_s=0.1).publish("jobs/a/1/x", path).bytes == 3_000_000


def test_what_is_stored_is_not_held_in_memory(tmp_path):
    """An upload may be half a gigabyte, and several come at once."""
    path = tmp_path / "large"
    path.write_bytes(bytes(64 << 20))
    said = subprocess.run(
        [sys.executable, "-c", PUBLISH, f"file://{tmp_path}/store", path],
        capture_output=True,
        text=True,
        check=True,
    )
    assert int(said.stdout) < 16 << 10, "kB beyond what the process had"


def test_the_first_who_publishes_wins(store, source, tmp_path):
    other = tmp_path / "other"
    other.write_bytes(b"other")
    store.publish("jobs/a/1/x", source)
    with pytest.raises(Exists):
        store.publish("jobs/a/1/x", other)
    assert store.size("jobs/a/1/x") == len(CONTENT)


def test_publishing_the_same_again_is_no_conflict(store, source):
    """As when the answer to the first call was lost."""
    assert store.publish("jobs/a/1/x", source) == store.publish("jobs/a/1/x", source)


def test_of_many_who_publish_at_once_one_wins(store, tmp_path):
    paths = [tmp_path / f"source-{number}" for number in range(6)]
    outcomes = []
    for number, path in enumerate(paths):
        path.write_bytes(bytes([number]) * 100_000)

    def publish(path):
        try:
            outcomes.append(store.publish("jobs/a/1/x", path).sha256)
        except Exists:
            outcomes.append(None)

    threads = [threading.Thread(target=publish, args=(path,)) for path in paths]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    (winner,) = [outcome for outcome in outcomes if outcome]
    assert sha256(b"".join(store.stream("jobs/a/1/x"))).hexdigest() == winner


def test_a_prefix_is_deleted_and_nothing_beside_it(store, source):
    for key in ("jobs/a/1/x", "jobs/a/2/x", "jobs/ab/1/x"):
        store.publish(key, source)
    assert store.list("jobs/a/") == ["jobs/a/1/x", "jobs/a/2/x"]
    store.delete("jobs/a/")
    store.delete("jobs/a/")
    assert store.list() == ["jobs/ab/1/x"]
    store.delete("jobs/ab/1/x")
    assert store.list() == []


def test_what_is_not_there_is_said(store, tmp_path):
    assert store.size("jobs/none") is None
    with pytest.raises(StorageError):
        list(store.stream("jobs/none"))
    with pytest.raises(StorageError):
        store.fetch("jobs/none", tmp_path / "copy")
    assert store.list("jobs/none/") == []


def test_it_can_be_written(store):
    assert store.writable()
    assert store.list() == []


@pytest.mark.parametrize(
    "key", ["../x", "/etc/passwd", "a/../b", "a//b", ".hidden", "a/.b", "a b", "", "a\n", "a/"]
)
def test_only_keys_of_ours_are_taken(tmp_path, source, key):
    with pytest.raises(ValueError, match="not a key"):
        Storage(f"file://{tmp_path}/store").publish(key, source)


@pytest.mark.parametrize("url", ["", "/tmp", "http://x/y", "file://host/x", "s3://", "ftp://a"])
def test_only_folders_and_buckets_are_stores(url):
    with pytest.raises(InputError, match="expected file:///FOLDER or s3://BUCKET"):
        Storage(url)


def test_a_folder_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be made"):
        Storage(f"file://{tmp_path}/file/store")


def test_a_bucket_that_is_away_is_an_error_of_the_store(source, monkeypatch):
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "k")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "s")
    store = Storage("s3://twins/x", patience_s=0.1)
    assert not store.writable()
    for call in (lambda: store.publish("jobs/a", source), lambda: store.size("jobs/a"), store.list):
        with pytest.raises(StorageError):
            call()
    assert store.free_bytes() is None


@pytest.mark.skipif(os.geteuid() != 0, reason="mounting takes root")
def test_a_full_disk_leaves_nothing_behind(tmp_path, source):
    place = tmp_path / "small"
    place.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(place)], check=True)
    try:
        store = Storage(f"file://{place}")
        with pytest.raises(StorageError, match="No space left"):
            store.publish("jobs/a/1/x", source)
        assert [path for path in place.rglob("*") if path.is_file()] == []
        small = tmp_path / "small-file"
        small.write_bytes(b"1")
        store.publish("jobs/a/1/x", small)
        (place / "balloon").write_bytes(bytes(store.free_bytes()))
        assert not store.writable()
    finally:
        subprocess.run(["umount", str(place)], check=True)


def test_what_a_killed_writer_left_goes_with_its_prefix(tmp_path, source):
    store = Storage(f"file://{tmp_path}/store")
    store.publish("jobs/a/1/x", source)
    shutil.copy(source, tmp_path / "store/jobs/a/1/y#1")  # how obstore names a file before it is whole
    assert store.list() == ["jobs/a/1/x"]
    store.delete("jobs/a/")
    assert not (tmp_path / "store/jobs/a").exists()
