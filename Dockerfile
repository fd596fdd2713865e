# syntax=docker/dockerfile:1
# Two images of one source. `front` answers HTTP: no torch, no compiler. `worker` makes twins, and exports them in every
# format, hence the extra `usd`.
#
#   docker build --target front  -t matphys-front .
#   docker build --target worker -t matphys-worker .
ARG PYTHON_IMAGE=python:3.11-slim-bookworm

FROM ${PYTHON_IMAGE} AS build
# Where torch comes without CUDA; `+cpu` versions sort before those of the main index.
ARG TORCH_INDEX=https://download.pytorch.org/whl/cpu
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
WORKDIR /source
COPY pyproject.toml constraints.txt ./
COPY deploy/requirements.py deploy/
# Dependencies first: they stay when only our own code changes.
RUN python deploy/requirements.py > front.txt \
 && python -c "import tomllib; p = tomllib.load(open('pyproject.toml', 'rb'))['project']; print('\n'.join(p['dependencies'] + p['optional-dependencies']['usd']))" > worker.txt \
 && python -m venv /opt/front \
 && /opt/front/bin/pip install --constraint constraints.txt --requirement front.txt \
 && python -m venv /opt/worker \
 && /opt/worker/bin/pip install --constraint constraints.txt --extra-index-url "${TORCH_INDEX}" --requirement worker.txt
COPY README.md LICENSE ./
COPY model model
COPY worker worker
COPY service service
RUN /opt/worker/bin/pip wheel --no-deps --wheel-dir /wheels . \
 && /opt/front/bin/pip install --no-deps /wheels/*.whl \
 && /opt/worker/bin/pip install --no-deps /wheels/*.whl \
 && /opt/front/bin/python -c "import service.main, worker.inspection.__main__, worker.inspection.video, worker.inspection.depth, worker.inspection.controllers" \
 && /opt/worker/bin/python -c "import worker.main, model.pipeline, model.exports, pxr.UsdVol"

FROM ${PYTHON_IMAGE} AS base
ENV PYTHONUNBUFFERED=1
# The folders that volumes are mounted on: a new volume takes their owner over.
RUN useradd --uid 10001 --user-group --no-create-home --home-dir /nonexistent --shell /usr/sbin/nologin matphys \
 && mkdir -p /data /cache /scratch \
 && chown matphys:matphys /data /cache /scratch

FROM base AS front
COPY --from=build /opt/front /opt/front
ENV PATH=/opt/front/bin:${PATH} MATPHYS_DATA_DIR=/data
USER 10001:10001
VOLUME ["/data"]
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=5s --start-period=10s --retries=3 \
  CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8000/livez', timeout=4)"]
ENTRYPOINT ["matphys-serve"]
CMD ["--host", "0.0.0.0", "--port", "8000", "--data-dir", "/data"]

FROM base AS worker
# The simulator's kernels are compiled for the processor they run on, so the compiler comes along; what it made
# stays in the volume /cache. Without a compiler plain torch would serve, many times slower.
# hadolint ignore=DL3008
RUN apt-get update \
 && apt-get install --yes --no-install-recommends g++ \
 && rm -rf /var/lib/apt/lists/*
COPY --from=build /opt/worker /opt/worker
COPY deploy/worker_alive.py /opt/worker/
ENV PATH=/opt/worker/bin:${PATH} XDG_CACHE_HOME=/cache MATPHYS_SCRATCH=/scratch OMP_NUM_THREADS=1
USER 10001:10001
VOLUME ["/cache", "/scratch"]
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=30s --timeout=10s --start-period=60s --retries=3 \
  CMD ["python", "/opt/worker/worker_alive.py"]
ENTRYPOINT ["matphys-worker"]
