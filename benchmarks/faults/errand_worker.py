"""`matphys-worker` that also runs errands (`errand.py`), with none of the model imported."""

import sys
from pathlib import Path

from errand import ErrandKind

from worker.jobs import Place
from worker.kinds import ALL_KINDS
from worker.main import Settings, serve

if __name__ == "__main__":
    redis_url, store_url, scratch, grace, mercy, limit = sys.argv[1:7]
    place = Place(redis_url, store_url, webhooks_to_private=True)
    serve(
        Settings(place, Path(scratch), grace_s=float(grace), mercy_s=float(mercy)),
        (*ALL_KINDS, ErrandKind(float(limit))),
        warm=(),
    )
