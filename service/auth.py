"""API keys: who asks, and what they may."""

import hashlib
import hmac
import json
import secrets
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Literal, TypeAlias, get_args

from redis import Redis

from model.errors import InputError

Scope: TypeAlias = Literal["submit", "read", "admin"]
SCOPES: tuple[Scope, ...] = get_args(Scope)
KEYS = "matphys:keys"
"""A hash: id of a key → what is known of it."""
FIRST_KEY = "matphys:keys:first"
"""Set when the first key was made, so that of two fronts that start together one makes it."""
NAME_LIMIT = 64


@dataclass(frozen=True)
class ApiKey:
    """What is known of a key; the key itself is not."""

    id: str
    tenant: str
    """Whose jobs it reaches."""
    scopes: tuple[Scope, ...]
    name: str
    created_at: str
    """RFC 3339, UTC."""

    def allows(self, scope: Scope) -> bool:
        """`admin` includes the others, for the jobs of every tenant."""
        return scope in self.scopes or "admin" in self.scopes


class ApiKeys:
    """The keys of a service, in its Redis.

    A key reads `mp_<id>_<secret>`: the id finds the record, the record holds the sha256 of the secret. The
    secret is 256 random bits, which nobody can try out, so a slow hash would protect nothing more.
    """

    def __init__(self, redis: Redis) -> None:
        """Keep the connection."""
        self._redis = redis

    def create(self, name: str, tenant: str, scopes: Sequence[Scope]) -> tuple[ApiKey, str]:
        """Make a key; returns what is known of it, and the key, which is shown now and never again.

        Raises:
            InputError: no scope or an unknown one; a name or tenant that is not a short word.
        """
        unknown = [scope for scope in scopes if scope not in SCOPES]
        if unknown or not scopes:
            raise InputError(f"scopes {', '.join(unknown) or '(none)'}: choose of {', '.join(SCOPES)}")
        for what, text in (("name", name), ("tenant", tenant)):
            if not 0 < len(text) <= NAME_LIMIT or not text.replace("-", "").replace("_", "").isalnum():
                raise InputError(f"{what} {text!r}: expected up to {NAME_LIMIT} letters, digits, - and _")
        now = datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
        key = ApiKey(
            secrets.token_hex(6), tenant, tuple(scope for scope in SCOPES if scope in scopes), name, now
        )
        secret = secrets.token_urlsafe(32)
        self._redis.hset(KEYS, key.id, json.dumps(asdict(key) | {"sha256": _digest(secret)}))
        return key, f"mp_{key.id}_{secret}"

    def create_first(self) -> str | None:
        """Make a key that may do everything, if there never was one; returns it."""
        if self._redis.hlen(KEYS) or not self._redis.set(FIRST_KEY, "made", nx=True):
            return None
        return self.create("first", "default", SCOPES)[1]

    def check(self, text: str) -> ApiKey | None:
        """The record of a key; None: there is no such key."""
        prefix, _, rest = text.partition("_")
        key_id, _, secret = rest.partition("_")
        found = self._redis.hget(KEYS, key_id) if prefix == "mp" and len(key_id) == 12 else None
        record = json.loads(found) if isinstance(found, str | bytes) else {"sha256": ""}
        # Compared for an unknown id too: the time taken does not tell an id that exists.
        good = hmac.compare_digest(_digest(secret), str(record.pop("sha256")).ljust(64))
        return _key(record) if good and record else None

    def list(self) -> list[ApiKey]:
        """All keys, oldest first."""
        records = [json.loads(value) for value in self._redis.hvals(KEYS)]
        for record in records:
            del record["sha256"]
        return sorted((_key(record) for record in records), key=lambda key: (key.created_at, key.id))

    def revoke(self, key_id: str) -> bool:
        """Forget a key, from the next request on; False: there is none with this id."""
        return bool(self._redis.hdel(KEYS, key_id))


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()


def _key(record: dict[str, object]) -> ApiKey:
    fields = record | {"scopes": tuple(record["scopes"])}  # type: ignore[arg-type]
    return ApiKey(**fields)  # type: ignore[arg-type]
