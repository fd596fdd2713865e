"""What schemathesis is told of files: clips that are some, so that twins come into being."""

import os
from pathlib import Path

import schemathesis
from hypothesis import strategies

clips = strategies.just(Path(os.environ["MATPHYS_TEST_CLIP"]).read_bytes())
schemathesis.openapi.format("binary", strategies.one_of(clips, strategies.binary()))
schemathesis.openapi.media_type("video/mp4", clips)
schemathesis.openapi.media_type("application/octet-stream", strategies.one_of(clips, strategies.binary()))
