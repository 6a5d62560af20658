# otwarp in a container: `docker build --target cpu -t otwarp .`, or `--target cuda` for NVIDIA GPUs
# (`docker run --gpus all -v "$PWD:/work" otwarp run cell_delivery`). docs/install.md says what was tried.

FROM python:3.12-slim AS build
WORKDIR /source
COPY . .
# the version: from the tags where .git is in the context, else from the archive, else the fallback of pyproject.toml
RUN pip install --no-cache-dir build==1.6.1 && python -m build --wheel --outdir /wheels .

FROM python:3.12-slim AS cpu
RUN useradd --create-home --uid 10001 otwarp && mkdir /work && chown 10001 /work
COPY constraints.txt /tmp/constraints.txt
RUN --mount=type=bind,from=build,source=/wheels,target=/wheels \
    pip install --no-cache-dir --constraint /tmp/constraints.txt "$(ls /wheels/*.whl)[mesh,studies]"
USER 10001
WORKDIR /work
ENTRYPOINT ["otwarp"]

# Warp brings its compiler along: of CUDA only the driver is needed, which the host lends
FROM nvidia/cuda:12.8.1-base-ubuntu24.04 AS cuda
# the distribution's own Python, in whatever patch release it is kept at
# hadolint ignore=DL3008
RUN apt-get update && apt-get install --yes --no-install-recommends python3 python3-venv && rm -rf /var/lib/apt/lists/*
RUN python3 -m venv /opt/otwarp && useradd --create-home --uid 10001 otwarp && mkdir /work && chown 10001 /work
ENV PATH="/opt/otwarp/bin:$PATH"
COPY constraints.txt /tmp/constraints.txt
RUN --mount=type=bind,from=build,source=/wheels,target=/wheels \
    pip install --no-cache-dir --constraint /tmp/constraints.txt "$(ls /wheels/*.whl)[mesh,studies]"
USER 10001
WORKDIR /work
ENTRYPOINT ["otwarp"]
