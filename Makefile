# make demo: the paper's two parts, its tables beside ours, a report. make test: everything that must hold.
PYTHON ?= python3
VENV := .venv
LOCK := --no-emit-index-url --no-header --python-version 3.11
BIN := $(VENV)/bin

.PHONY: demo test checked lint docs docs-serve release-check bench bench-quick bench-register install lock clean

demo: install
	$(BIN)/edgel demo -o demo

test: install lint
	$(BIN)/pytest -n 2 --dist loadfile

# The kernels with every index checked, by two processes: none reads or writes outside its arrays.
checked: install
	NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR=$(CURDIR)/$(VENV)/checked $(BIN)/pytest -q -n 2 tests/kernels tests/neighbors tests/surface/test_evidence.py tests/range_image tests/color tests/test_golden.py tests/test_from_depth.py tests/fuzz/test_fuzz_detect.py

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright

# The pages as a site, in site/; a warning is an error.
docs: $(VENV)/installed-release
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

docs-serve: $(VENV)/installed-release
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs serve

# All that a release must hold; packages to upload lie in dist/ then. It needs the network, and half an hour.
release-check: docs
	$(BIN)/python packaging/release_check.py

$(VENV)/installed-release: $(VENV)/installed requirements-release.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement requirements-release.lock
	touch $@

# The benchmark needs more (Open3D and build123d are large); PCL and CGAL come from Debian, build.sh says how.
bench: $(VENV)/installed-bench
	$(BIN)/python benchmarks/bench.py

bench-quick: $(VENV)/installed-bench
	$(BIN)/python benchmarks/bench.py --quick

bench-register: $(VENV)/installed-bench
	$(BIN)/python benchmarks/register.py

$(VENV)/installed-bench: $(VENV)/installed requirements-bench.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement requirements-bench.lock
	-bash benchmarks/rivals/build.sh
	touch $@

install: $(VENV)/installed

$(VENV)/installed: pyproject.toml requirements.lock
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "edgel needs Python 3.11 or newer; call make with PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@

# Versions of everything, for every platform, from pyproject.toml.
lock:
	$(BIN)/python -m pip install --quiet uv
	$(BIN)/uv pip compile --universal --upgrade --extra dev --extra e57 $(LOCK) --output-file requirements.lock pyproject.toml
	$(BIN)/uv pip compile --universal --upgrade --extra docs --extra release --constraint requirements.lock $(LOCK) --output-file requirements-release.lock pyproject.toml
	$(BIN)/uv pip compile --universal --upgrade --extra bench --constraint requirements.lock $(LOCK) --output-file requirements-bench.lock pyproject.toml

clean:
	rm -rf $(VENV) demo site dist
