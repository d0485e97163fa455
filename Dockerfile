# syntax=docker/dockerfile:1
# One image for every process; compose.yaml says which one a container runs.
#
# The base is an argument, so that whoever builds can pin the digest that they have checked:
#   docker build --build-arg BASE_IMAGE=docker.io/library/python:3.11-slim-bookworm@sha256:... .
ARG BASE_IMAGE=docker.io/library/python:3.11-slim-bookworm

# The project's wheel; the tools that build it stay in this stage.
FROM ${BASE_IMAGE} AS wheel
WORKDIR /src
COPY requirements.lock ./
RUN python -m venv /tools && /tools/bin/pip install --no-cache-dir --require-hashes -r requirements.lock -c requirements.lock
COPY pyproject.toml README.md LICENSE ./
COPY assets assets
COPY web web
COPY rolling_panda rolling_panda
COPY bridge bridge
COPY controller controller
COPY perception perception
COPY recorder recorder
COPY labelling labelling
COPY server server
RUN /tools/bin/pip wheel --no-cache-dir --no-deps --no-build-isolation --wheel-dir /wheel .

# What runs: locked dependencies first, as they change seldom. LOCK=requirements-real.lock brings the real robot's drivers.
FROM ${BASE_IMAGE} AS install
ARG LOCK=requirements-run.lock
COPY requirements-run.lock requirements-real.lock /
RUN python -m venv /app && /app/bin/pip install --no-cache-dir --require-hashes -r /${LOCK} -c /${LOCK}
COPY --from=wheel /wheel /wheel
RUN /app/bin/pip install --no-cache-dir --no-deps /wheel/*.whl

# The bill of materials of what was installed, as CycloneDX.
FROM wheel AS materials
COPY --from=install /app /app
RUN /tools/bin/cyclonedx-py environment --output-reproducible --output-format JSON \
    --output-file /materials.cdx.json /app/bin/python

FROM ${BASE_IMAGE}
# Pinocchio is linked against the OpenMP library, which the slim image does not have. Which version of it is the base's
# choice, as with all that comes with the base.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends libgomp1 libusb-1.0-0 \
    && rm -rf /var/lib/apt/lists/*
# Which state of the source this is, told at /version:  --build-arg REVISION=$(git rev-parse HEAD)
ARG REVISION=
LABEL org.opencontainers.image.revision=$REVISION
ENV ROLLING_PANDA_REVISION=$REVISION
LABEL org.opencontainers.image.title="Rolling Panda" \
      org.opencontainers.image.description="Browser supervision and teleoperation of a mobile manipulator that prunes grapevines" \
      org.opencontainers.image.licenses="BSD-3-Clause"
RUN useradd --uid 10001 --no-log-init --no-create-home --shell /usr/sbin/nologin panda
COPY --from=install /app /app
COPY --from=materials /materials.cdx.json /usr/share/rolling-panda/materials.cdx.json
# The control code as machine code: made once here, kept in a folder that a container can write to, since the code is made
# again on a processor of another kind.
ENV NUMBA_CACHE_DIR=/var/cache/rolling-panda
# What survives a restart is in a folder of its own: a volume that is mounted here belongs to this user too.
RUN install --directory --owner 10001 --group 10001 $NUMBA_CACHE_DIR \
    && install --directory --owner 10001 --group 10001 --mode 700 /var/lib/rolling-panda \
    && for name in router bridge controller perception server recorder; do \
        install --directory --owner 10001 --group 10001 --mode 700 "/certificates/$name"; done
# MuJoCo computes here and draws nothing, so it needs no OpenGL. One thread of linear algebra a process: see launch.py.
ENV PATH=/app/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    MUJOCO_GL=disable
USER 10001:10001
RUN python -c "import controller.core"
WORKDIR /tmp
STOPSIGNAL SIGTERM
ENTRYPOINT ["rolling-panda"]
CMD ["--help"]
