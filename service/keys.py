"""`matphys-serve keys`: make, list and revoke API keys."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click
from redis.exceptions import RedisError

from model.errors import InputError
from service.auth import SCOPES, ApiKeys, Scope
from service.settings import DATA_DIR
from worker.embedded import EmbeddedRedis, running_address
from worker.queues import connect


@click.group()
def keys() -> None:
    """Make, list and revoke API keys."""


@keys.command()
@click.argument("name")
@click.option(
    "--scope", "scopes", multiple=True, type=click.Choice(SCOPES), help="May be given several times."
)
@click.option("--tenant", default="default", show_default=True, help="Whose jobs the key reaches.")
@DATA_DIR
def create(name: str, scopes: tuple[Scope, ...], tenant: str, data_dir: Path) -> None:
    """Make a key called NAME and print it; it is shown only now."""
    with _api_keys(data_dir) as api_keys:
        _, text = api_keys.create(name, tenant, scopes or ("submit", "read"))
    click.echo(f"API key: {text}")


@keys.command("list")
@DATA_DIR
def list_keys(data_dir: Path) -> None:
    """Print id, tenant, scopes, name and time of every key."""
    with _api_keys(_used(data_dir)) as api_keys:
        for key in api_keys.list():
            click.echo(f"{key.id}  {key.tenant}  {','.join(key.scopes)}  {key.name}  {key.created_at}")


@keys.command()
@click.argument("key_id", metavar="ID")
@DATA_DIR
def revoke(key_id: str, data_dir: Path) -> None:
    """Revoke the key with the ID that `list` shows, from the next request on."""
    with _api_keys(_used(data_dir)) as api_keys:
        if not api_keys.revoke(key_id):
            raise InputError(f"there is no key {key_id}: `matphys-serve keys list` shows them")
    click.echo(f"revoked {key_id}")


@contextmanager
def api_keys_at(url: str, patience_s: float) -> Iterator[ApiKeys]:
    """The keys in the Redis of an address.

    Raises:
        InputError: it is none, or no Redis answers there.
    """
    try:
        with connect(url, patience_s) as client:
            yield ApiKeys(client)
    except RedisError as error:
        raise InputError(f"REDIS_URL: Redis does not answer ({type(error).__name__})") from None


def _used(data_dir: Path) -> Path:
    """A folder that a service has been in.

    Raises:
        InputError: none has, so there are no keys.
    """
    if not os.environ.get("REDIS_URL") and not (data_dir / "redis").is_dir():
        raise InputError(f"--data-dir {data_dir}: no service has run here, so there are no keys")
    return data_dir


@contextmanager
def _api_keys(data_dir: Path) -> Iterator[ApiKeys]:
    """The keys in the Redis that REDIS_URL names, or that runs over the data folder, or rests in it."""
    url = os.environ.get("REDIS_URL") or running_address(data_dir / "redis")
    if url is None:
        with EmbeddedRedis(data_dir / "redis") as redis, connect(redis.url) as client:
            yield ApiKeys(client)
    else:
        with api_keys_at(url, patience_s=2.0) as api_keys:
            yield api_keys
