"""Logs of the worker: one JSON object a line on stderr, with the job they are about."""

import json
import logging
import sys
from datetime import UTC, datetime
from typing import Final

FIELDS: Final = ("worker", "job", "kind", "attempt", "stage", "seconds", "outcome", "count")


class JsonFormatter(logging.Formatter):
    """A record as one line of JSON."""

    def __init__(self, worker: str, job: str | None = None, attempt: int | None = None) -> None:
        """What every line says: who wrote it, and in the process of a job, which."""
        super().__init__()
        self._always: dict[str, str | int | None] = {"worker": worker}
        if job is not None:
            self._always |= {"job": job, "attempt": attempt}

    def format(self, record: logging.LogRecord) -> str:
        """Time, level, message, what it is about, and the traceback if any."""
        at = datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds")
        line = {
            "at": at.replace("+00:00", "Z"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
            **self._always,
        }
        line |= {name: getattr(record, name) for name in FIELDS if hasattr(record, name)}
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=False, default=str)


def log_as_json(worker: str, job: str | None = None, attempt: int | None = None) -> None:
    """Send all logs of this process to stderr in this form."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonFormatter(worker, job, attempt))
    logging.basicConfig(level=logging.WARNING, handlers=[handler], force=True)
    logging.getLogger("matphys").setLevel(logging.INFO)
    logging.captureWarnings(True)


def relay(line: str, job: str, attempt: int) -> None:
    """Pass on what the process of a job wrote: its own logs as they are, anything else inside a log line."""
    if line.startswith('{"at"'):
        sys.stderr.write(line if line.endswith("\n") else line + "\n")
        sys.stderr.flush()
    elif line.strip():
        logging.getLogger("matphys.horse").warning(line.rstrip(), extra={"job": job, "attempt": attempt})
