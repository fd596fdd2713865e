import pytest
import redis
import redis.exceptions

from worker.scripts import NAMES, Scripts


@pytest.fixture
def calls(monkeypatch):
    """What is sent, and over which connection."""
    calls = []
    plain = redis.Redis.execute_command

    def execute(self, *arguments, **options):
        calls.append((arguments[0], id(self.connection) if self.connection else None))
        return plain(self, *arguments, **options)

    monkeypatch.setattr(redis.Redis, "execute_command", execute)
    return calls


def test_redis_takes_every_script(client):
    for name in NAMES:
        assert client.script_load(Scripts(client)._scripts[name].script)


def test_a_script_is_sent_again_when_redis_has_forgotten_it(client):
    scripts = Scripts(client)
    assert scripts("cancel", "nowhere") is None
    client.script_flush()
    assert scripts("cancel", "nowhere") is None


def test_what_must_last_is_waited_for_on_the_connection_that_wrote_it(client, calls, monkeypatch):
    monkeypatch.setattr(redis.Redis, "waitaof", lambda self, *a: self.execute_command("ECHO", "x") and (1, 0))
    Scripts(client).settled("cancel", "nowhere")
    (wrote, where), (waited, there) = [call for call in calls if call[0] in ("EVALSHA", "ECHO")]
    assert (wrote, waited) == ("EVALSHA", "ECHO")
    assert where is not None
    assert where == there


def test_a_job_and_all_that_was_made_of_it_waits_for_the_disk_once(client, records, errand, monkeypatch):
    """To wait for each took a second of each where the file is synced every second."""
    waited = []
    monkeypatch.setattr(redis.Redis, "waitaof", lambda self, *a: waited.append(a) or (1, 0))
    twin = errand()
    records.create(twin)
    children = [errand().model_copy(update={"parent": twin.id}) for _ in range(3)]
    for child in children:
        records.create(child)
    waited.clear()
    records.delete(twin.id)
    assert len(waited) == 1
    assert [records.get(record.id) for record in (twin, *children)] == [None] * 4


def test_a_disk_that_does_not_take_it_is_an_error(client, monkeypatch):
    monkeypatch.setattr(redis.Redis, "waitaof", lambda self, *a: (0, 0))
    with pytest.raises(redis.exceptions.TimeoutError, match="too slow"):
        Scripts(client).settled("cancel", "nowhere")


def test_a_redis_that_cannot_tell_is_asked_once(client, monkeypatch):
    asked = []

    def refuse(self, *arguments):
        asked.append(arguments)
        raise redis.exceptions.ResponseError("unknown command `WAITAOF`")

    monkeypatch.setattr(redis.Redis, "waitaof", refuse)
    scripts = Scripts(client)
    for _ in range(3):
        assert scripts.settled("cancel", "nowhere") is None
    assert len(asked) == 1
