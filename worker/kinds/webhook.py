"""The end of a job → a message to whoever asked for it. The transitions make these jobs, no request does."""

import json
from typing import ClassVar, Final

from pydantic import BaseModel

from model.errors import InputError
from model.job_schema import PROBLEM
from worker.kinds.base import GIBIBYTE, Kind, Outcome, OutOfTimeError, Postponed, Run
from worker.record import JobRecord
from worker.webhooks import Undelivered

PAUSES_S: Final = (5.0, 30.0, 300.0, 1800.0, 7200.0, 18000.0, 36000.0)
"""Between one try and the next [s]; after the last one it is given up."""


class NoOptions(BaseModel):
    """Nothing to choose."""


class WebhookKind(Kind):
    """One message, tried again for most of a day."""

    name: ClassVar[str] = "webhook"
    queue: ClassVar[str] = "webhooks"
    options: ClassVar[type[BaseModel]] = NoOptions
    # twice the patience of `worker.webhooks`: one that drips is tried again, like one that is silent
    limit_s: ClassVar[float] = 30.0
    memory_bytes: ClassVar[int] = GIBIBYTE

    def run(self, run: Run) -> Outcome:
        """Send it; the message id stays the same, so that a receiver can tell a repetition."""
        if run.parent is None or run.parent.webhook is None:
            return Outcome()
        # not the attempts, of which some never came to send anything
        tries = run.record.postponed + 1
        try:
            run.send(run.parent.webhook, run.record.id, message(run.parent))
        except (Undelivered, OutOfTimeError) as error:
            problem = error if isinstance(error, Undelivered) else "the answer took too long"
            if tries > len(PAUSES_S):
                raise InputError(f"webhook: gave up after {tries} tries: {problem}") from None
            run.log(f"webhook: try {tries}: {problem}")
            raise Postponed(PAUSES_S[tries - 1]) from None
        return Outcome()


def message(record: JobRecord) -> bytes:
    """What the receiver is told: that it ended and how; everything else it asks for, with its key."""
    ended = None if record.completed_at is None else record.completed_at.isoformat().replace("+00:00", "Z")
    error = None if record.error is None else record.error.model_dump()
    if error is not None:
        error["type"] = PROBLEM + error["type"]
    data = {
        "id": record.id,
        "kind": record.kind,
        "status": record.status,
        "parent": record.parent,
        "error": error,
    }
    return json.dumps({"type": f"{record.kind}.{record.status}", "timestamp": ended, "data": data}).encode()
