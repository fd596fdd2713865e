"""A front that also takes errands (`errand.py`), at `/errands`."""

import os
import sys
from pathlib import Path

import uvicorn
from errand import ErrandKind

from service.app import create_app
from service.logs import log_as_json
from service.resources import Resource
from service.settings import Settings

if __name__ == "__main__":
    redis_url, store_url, data, port = sys.argv[1:5]
    settings = Settings.from_environment(
        os.environ, data_dir=Path(data), redis_url=redis_url, store_url=store_url
    )
    log_as_json("WARNING")
    app = create_app(settings, [Resource(ErrandKind, "/errands", "errand")])
    uvicorn.run(app, port=int(port), log_config=None, access_log=False)
