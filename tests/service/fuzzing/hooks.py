"""What schemathesis is told of files: clips and observations that are some, so that jobs come into being."""

import os
from pathlib import Path

import schemathesis
from hypothesis import strategies

clips = strategies.just(Path(os.environ["MATPHYS_TEST_CLIP"]).read_bytes())
observations = strategies.just(Path(os.environ["MATPHYS_TEST_OBSERVATION"]).read_bytes())
files = strategies.one_of(clips, observations, strategies.binary())
schemathesis.openapi.format("binary", files)
schemathesis.openapi.media_type("video/mp4", clips)
schemathesis.openapi.media_type("application/octet-stream", files)
