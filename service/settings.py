"""What an operator may set: environment variables, and the options of `matphys-serve`."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Self

import click

from model.errors import InputError

MEBIBYTE = 1 << 20
LONGEST_KEPT = 1_000_000
"""Hours that a job may be kept: a century; what ends much later has no date."""


@dataclass(frozen=True)
class Settings:
    """How a front serves. Every field is an environment variable, `MATPHYS_` and its name in capitals.

    `redis_url` and `store_url` are also read from `REDIS_URL` and `STORE_URL`.
    """

    redis_url: str = field(repr=False)
    """May hold a password, so it is never shown."""
    store_url: str
    """`file:///path` or `s3://bucket/prefix`."""
    data_dir: Path
    """Where uploads wait until they are checked; for a local store, on its file system."""
    max_upload_mib: int = 512
    """Of one request, all of its files together."""
    max_jobs: int = 1000
    """Waiting in one queue, of all tenants; beyond it: 503."""
    max_jobs_per_tenant: int = 100
    """Of one kind, waiting and running; beyond it: 429."""
    submissions_per_minute: int = 120
    """Of one key."""
    requests_per_minute: int = 6000
    """Of one key."""
    refusals_per_minute: int = 60
    """Requests without a good key from one address; beyond it: 429."""
    min_free_mib: int = 1024
    """Left on the disk of `data_dir`; below it nothing is accepted: 503."""
    retention_hours: float = 168.0
    """How long a job and its files are kept after its end."""
    inspections: int = 2
    """Uploads looked into at the same time."""
    idle_seconds: float = 30.0
    """An upload that sends nothing for this long is given up: 408."""
    log_level: str = "INFO"

    @property
    def max_upload_bytes(self) -> int:
        """Of one request."""
        return self.max_upload_mib * MEBIBYTE

    @property
    def min_free_bytes(self) -> int:
        """Left on the disk."""
        return self.min_free_mib * MEBIBYTE

    @property
    def staging(self) -> Path:
        """Where uploads wait."""
        return self.data_dir / "staging"

    @classmethod
    def from_environment(
        cls, environment: Mapping[str, str], *, data_dir: Path, redis_url: str, store_url: str
    ) -> Self:
        """Read the numbers of the environment.

        Args:
            environment: `os.environ`, or what stands for it.
            data_dir: As the caller has settled it, like the two addresses.
            redis_url: Where Redis is.
            store_url: Where bytes live.

        Raises:
            InputError: a variable that is no positive number.
        """
        numbers: dict[str, Any] = {
            each.name: _number(environment, name, each.type)
            for each in fields(cls)
            if each.type in (int, float) and (name := f"MATPHYS_{each.name.upper()}") in environment
        }
        kept = numbers.get("retention_hours", cls.retention_hours)
        if kept > LONGEST_KEPT:
            raise InputError(
                f"MATPHYS_RETENTION_HOURS={environment['MATPHYS_RETENTION_HOURS']}: at most {LONGEST_KEPT}"
            )
        level = environment.get("MATPHYS_LOG_LEVEL", cls.log_level).upper()
        if level not in ("DEBUG", "INFO", "WARNING", "ERROR"):
            raise InputError(f"MATPHYS_LOG_LEVEL={level}: choose DEBUG, INFO, WARNING or ERROR")
        return cls(redis_url, store_url, data_dir, log_level=level, **numbers)


def _number(environment: Mapping[str, str], name: str, kind: type[int] | type[float]) -> float:
    text = environment[name]
    try:
        value = kind(text)
    except ValueError:
        value = 0
    if not 0 < value < 1e12:
        raise InputError(f"{name}={text}: expected a positive {'whole ' if kind is int else ''}number")
    return value


def default_data_dir() -> Path:
    """Where data lie when nobody says where."""
    home = os.environ.get("XDG_DATA_HOME")
    return (Path(home) if home else Path.home() / ".local" / "share") / "matphys"


def _said_before(context: click.Context, parameter: click.Parameter, value: Path) -> Path:
    """The folder that was named before the command, as in `matphys-serve --data-dir X keys list`."""
    source = context.get_parameter_source(str(parameter.name))
    named = source is click.core.ParameterSource.COMMANDLINE
    if context.obj is None and named:
        context.obj = value
    return value if named or not isinstance(context.obj, Path) else context.obj


DATA_DIR = click.option(
    "--data-dir",
    callback=_said_before,
    type=click.Path(file_okay=False, path_type=Path),
    envvar="MATPHYS_DATA_DIR",
    default=default_data_dir,
    show_default="~/.local/share/matphys",
    help="Where jobs and files are kept. (MATPHYS_DATA_DIR does the same.)",
)
"""The option that every command has."""
