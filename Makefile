# Targets for newcomers: `make run`, `make check`, `make test`. They need Python >= 3.11, make and git, nothing else.
#   make run        build the demo firmware and run it on an emulated e-puck (core packages only)
#   make check      lint, types of changed packages and the quick tests: what to run before every commit
#   make test       everything: lint, types, all tests
#   make campaigns  random programs and inputs, with seeds that move on with the commit
#   make coverage   which lines of the Python code the quick tests run: docs/coverage.md
#   make arena, make bench, make site, make serve, make sbom, make clean
# Each target installs the extras it needs into .venv and says so.

# make splits words at blanks and expands `$`; a path with one of these characters cannot work.
HERE := $(CURDIR)
ifneq ($(words $(HERE)),1)
$(error this folder's path contains a blank: $(HERE); move the checkout to a path without blanks)
endif
ifneq ($(findstring :,$(HERE))$(findstring ',$(HERE))$(findstring ",$(HERE))$(findstring $$,$(HERE)),)
$(error this folder's path contains a quote, a colon or a dollar sign: $(HERE); move the checkout to another path)
endif

PYTHON ?= python3
VENV   := .venv
PY     := $(VENV)/bin/python
STAMP  := $(VENV)/.installed
APP    ?= listing1
SECONDS ?= 5
JOBS   ?= 2
TYPED  := emu toolchain arena openswarm
LINTED := $(TYPED) firmware tests bench docs setup.py
# --no-compile: Python compiles what it imports; compiling every file of the dependencies first takes longer
PIP    := $(PY) -m pip install --quiet --disable-pip-version-check --no-compile

firmware.elf: $(STAMP) FORCE
	$(MAKE) -s -C firmware APP=$(APP) PYTHON=$(abspath $(PY))
	cp firmware/build/$(APP)/firmware.elf $@.part && mv $@.part $@

run: firmware.elf
	$(PY) -m emu run firmware.elf --seconds $(SECONDS)

arena: $(VENV)/.extra-arena
	$(PY) -m arena run clustering --brain scripted --trials 1 --minutes 10 --out build/trial
	$(PY) -m arena replay build/trial/trial-0001.parquet --out build/trial.html
	@echo "open build/trial.html in a browser"

check: $(VENV)/.extra-arena $(VENV)/.extra-test
	$(PY) -m tests.check --jobs $(JOBS)

# mypy takes a core for half a minute: it runs beside the tests, and its result is printed after theirs in any case
test: $(VENV)/.extra-arena $(VENV)/.extra-film $(VENV)/.extra-docs $(VENV)/.extra-test
	$(PY) -m ruff check $(LINTED)
	@mkdir -p build
	@$(PY) -m mypy $(TYPED) >build/types 2>&1 & types=$$!; \
	$(PY) -m pytest -n $(JOBS) --dist worksteal -m "" tests $(PYTEST); tests=$$?; \
	wait $$types; types=$$?; cat build/types; exit $$((tests != 0 || types != 0))

coverage: $(VENV)/.extra-arena $(VENV)/.extra-test
	COVERAGE_CORE=sysmon $(PY) -m pytest -n $(JOBS) --dist worksteal --cov --cov-report=json:build/coverage.json $(PYTEST) tests
	$(PY) docs/tools/coverage_table.py build/coverage.json

bench: $(VENV)/.extra-arena $(VENV)/.extra-test
	$(PY) -m bench

campaigns: SECONDS = 300
campaigns: $(VENV)/.extra-arena $(VENV)/.extra-test
	$(PY) -m tests.fuzz --seconds $(SECONDS) --jobs $(JOBS)

site: $(VENV)/.extra-arena $(VENV)/.extra-docs
	$(PY) docs/tools/site.py --out build/site
	@echo "open build/site/index.html, or run: make serve"

serve: site
	$(PY) -m http.server --directory build/site --bind 127.0.0.1 8000

# every package of this environment with version and licence, as CycloneDX
sbom: $(VENV)/.extra-docs
	mkdir -p build
	$(PY) -m cyclonedx_py environment --pyproject pyproject.toml --output-reproducible -o build/sbom.json $(PY)

$(STAMP): pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed; set PYTHON=...")'
	$(PYTHON) -m venv $(VENV)
	$(PIP) --editable .
	touch $@

$(VENV)/.extra-%: $(STAMP)
	@echo "installing the extra '$*' (pyproject.toml says what is in it)"
	$(PIP) --editable '.[$*]'
	touch $@

clean:
	rm -rf firmware.elf firmware/build build

FORCE:
.PHONY: run arena check test coverage bench campaigns site serve sbom clean FORCE
.PRECIOUS: $(VENV)/.extra-%
