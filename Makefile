# Two commands set a fresh machine up: `make demo` and `make test`. Python 3.11+ and make are all they need.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: demo test thorough validate debian lint docs scenes schema figures blender gltf clean help

help:  ## list the targets
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/'

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "otwarp needs Python 3.11 or newer")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	@# setuptools warns of folders beside an editable package, which are the tests and benchmarks here
	PYTHONWARNINGS=ignore $(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	@touch $@

demo: $(READY)  ## run the cell delivery, draw it, say where to look
	$(BIN)/otwarp run scenes/cell_delivery.usda --forces --out out/cell_delivery
	$(BIN)/otwarp preview out/cell_delivery --camera closeup --time 3.9 --forces -o out/cell_delivery/frame.png

# linear algebra would take two threads in each of the tests that run at once, which wait for each other spinning
test thorough validate: export OMP_NUM_THREADS = 1
# without its files of byte code each of some hundred processes compiles the package anew
unexport PYTHONDONTWRITEBYTECODE

# most tests wait for the compiler alone; the others, with kernels as users have them. Some wait for a clock: three at once
test: $(READY)  ## run the tests (under 10 minutes on two cores, the first time)
	$(BIN)/python -m compileall -q -j 2 otwarp
	$(BIN)/python -m pytest -n 3 --dist worksteal -m "not stepping" --unoptimised
	$(BIN)/python -m pytest -n 3 --dist worksteal -m stepping

# bodies that touch have kernels of their own on GPUs: here they run on a CPU; tests that choose forms themselves have run
GPU_FORMS = $(addprefix tests/,kernels/drivers/grid \
	$(addprefix simulation/test_,body_space.py contact.py contact_chains.py inlets.py mesh_obstacles.py periodic.py sharded.py)) \
	--ignore=tests/kernels/drivers/grid/test_phases.py

thorough: $(READY)  ## run the files of tests that take longest, which `make test` leaves out
	$(BIN)/python -m pytest -n 3 --dist loadfile --thorough -m thorough
	$(BIN)/python -m pytest -n 3 --dist worksteal --thorough --gpu-forms $(GPU_FORMS)

validate: $(READY)  ## run all tests, the long statistical ones as well
	$(BIN)/python -m pytest -n 2 --dist loadfile --validate

debian:  ## as root: ROS 1, Fast DDS, Chromium, Octave and npm, for the tests that need them
	bash .ci/debian

lint: $(READY)  ## formatting, lint and types
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright

scenes: $(READY)  ## author the shipped scenes anew
	$(BIN)/python -m scenes.author

schema: $(READY)  ## write the USD schema and docs/scene.md from the vocabulary
	$(BIN)/python -m otwarp.scene.schema

figures: $(READY)  ## draw the pictures of docs/architecture.md from the code
	$(BIN)/python -m docs.figures

docs: $(READY)  ## build the site of the documentation into site/, warnings as errors
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet
	@echo "site/index.html"

blender:  ## Blender as a Python module, in an environment of its own (1 GB), for docs/recipes/blender.py
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11) and "Blender 5.0 needs Python 3.11: make blender PYTHON=python3.11")'
	$(PYTHON) -m venv .venv-blender
	.venv-blender/bin/python -m pip install --quiet bpy==5.0.1 'numpy<2'

gltf:  ## the validator of the Khronos Group, for a test of `otwarp export`; needs npm
	npm install --silent --no-save --prefix .node gltf-validator@2.0.0-dev.3.10

clean:  ## remove the environment and results
	rm -rf $(VENV) .venv-blender .node out site
