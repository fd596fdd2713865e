"""A kind of job that only passes time, and the front and the worker that take it.

python nap.py front DATA PORT        # REDIS_URL, STORE_URL and MATPHYS_* in the environment
python nap.py worker SCRATCH
"""

import os
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import uvicorn
from pydantic import BaseModel, ConfigDict

from worker.kinds import ALL_KINDS, Input, Kind, Outcome, Run


class NapOptions(BaseModel):
    """How long."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    seconds: float = 0.5


class NapKind(Kind):
    """Reads its input, sleeps, and gives it back."""

    name: ClassVar[str] = "nap"
    queue: ClassVar[str] = "twins"
    options: ClassVar[type[BaseModel]] = NapOptions
    inputs: ClassVar[Mapping[str, Input]] = {"note": Input("camera", required=True)}
    limit_s: ClassVar[float] = 60.0

    def run(self, run: Run) -> Outcome:
        """Sleep."""
        run.report("sleeping", 0.0)
        time.sleep(NapOptions.model_validate(run.record.options).seconds)
        result = run.folder / "note.json"
        result.write_bytes(run.inputs["note"].read_bytes())
        return Outcome((result,))


def serve_front(data: str, port: str) -> None:
    """A front that takes naps at `/naps`."""
    from service.app import create_app
    from service.resources import Resource
    from service.settings import Settings

    redis_url, store_url = os.environ["REDIS_URL"], os.environ["STORE_URL"]
    settings = Settings.from_environment(
        os.environ, data_dir=Path(data), redis_url=redis_url, store_url=store_url
    )
    app = create_app(settings, [Resource(NapKind, "/naps", "nap")])
    uvicorn.run(app, port=int(port), log_config=None, access_log=False)


def work(scratch: str) -> None:
    """A worker that takes naps, with nothing of the model imported."""
    from worker.jobs import Place
    from worker.main import Settings, serve

    place = Place(os.environ["REDIS_URL"], os.environ["STORE_URL"])
    serve(Settings(place, Path(scratch), grace_s=1.0), (*ALL_KINDS, NapKind()), warm=())


if __name__ == "__main__":
    {"front": serve_front, "worker": work}[sys.argv[1]](*sys.argv[2:])
