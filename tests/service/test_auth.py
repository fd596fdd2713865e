import json

import pytest

from model.errors import InputError
from service.auth import KEYS, SCOPES, ApiKeys
from worker.queues import connect


@pytest.fixture
def redis(redis_url):
    with connect(redis_url) as client:
        yield client


@pytest.fixture
def keys(redis):
    return ApiKeys(redis)


def test_a_key_is_known_by_its_text_alone(keys):
    key, text = keys.create("laptop", "lab", ("read", "submit"))
    assert keys.check(text) == key
    assert key.tenant == "lab"
    assert key.scopes == ("submit", "read")


def test_what_is_kept_does_not_tell_the_key(keys, redis):
    _, text = keys.create("laptop", "lab", ("read",))
    secret = text.rpartition("_")[2]
    kept = json.dumps(redis.hgetall(KEYS))
    assert secret not in kept
    assert text not in kept


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text[:-1],
        lambda text: text + "x",
        lambda text: text.swapcase(),
        lambda text: text.replace("mp_", "xx_"),
        lambda text: text.rpartition("_")[0] + "_",
        lambda text: "mp_000000000000_" + text.rpartition("_")[2],
        lambda text: "",
        lambda text: "mp__",
        lambda text: "mp_\0_\udcff",
        lambda text: "é" * 100_000,
    ],
)
def test_anything_else_is_no_key(keys, change):
    _, text = keys.create("laptop", "lab", ("read",))
    assert keys.check(change(text)) is None


def test_a_revoked_key_is_no_key(keys):
    key, text = keys.create("laptop", "lab", ("read",))
    _, other = keys.create("other", "lab", ("read",))
    assert keys.revoke(key.id)
    assert not keys.revoke(key.id)
    assert keys.check(text) is None
    assert keys.check(other) is not None


def test_keys_are_listed_oldest_first_without_their_hashes(keys):
    made = [keys.create(name, "lab", ("read",))[0] for name in ("a", "b")]
    assert sorted(keys.list(), key=lambda key: key.name) == made


def test_the_first_key_is_made_once(keys):
    text = keys.create_first()
    assert keys.check(text).scopes == SCOPES
    assert keys.create_first() is None
    keys.revoke(keys.check(text).id)
    assert keys.create_first() is None


def test_no_first_key_where_there_are_keys(keys):
    keys.create("laptop", "lab", ("read",))
    assert keys.create_first() is None


@pytest.mark.parametrize(
    ("name", "tenant", "scopes"),
    [
        ("", "lab", ("read",)),
        ("a", "", ("read",)),
        ("a", "lab", ()),
        ("a", "lab", ("root",)),
        ("a", "l:b", ("read",)),
        ("a" * 65, "lab", ("read",)),
        ("a", "-", ("read",)),
        ("a\n", "lab", ("read",)),
    ],
)
def test_a_key_that_makes_no_sense_is_not_made(keys, name, tenant, scopes):
    with pytest.raises(InputError):
        keys.create(name, tenant, scopes)


def test_admin_includes_the_rest(keys):
    admin, reader = keys.create("a", "lab", ("admin",))[0], keys.create("b", "lab", ("read",))[0]
    assert all(admin.allows(scope) for scope in SCOPES)
    assert [scope for scope in SCOPES if reader.allows(scope)] == ["read"]
