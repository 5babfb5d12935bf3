# Two commands for newcomers: `make run` and `make test`. They need Python >= 3.11, make and git, nothing else.
PYTHON ?= python3
VENV   := .venv
PY     := $(VENV)/bin/python
STAMP  := $(VENV)/.installed
APP    ?= listing1
SECONDS ?= 5
EXTRAS ?= arena,film,test
TYPED  := emu toolchain arena openswarm

firmware.elf: $(STAMP) FORCE
	$(MAKE) -C firmware APP=$(APP) PYTHON=$(abspath $(PY))
	cp firmware/build/$(APP)/firmware.elf $@.part && mv $@.part $@

run: firmware.elf
	$(PY) -m emu run firmware.elf --seconds $(SECONDS)

# types take a core for a minute: they are looked at beside the tests, and told behind them whatever the tests say
test: $(STAMP)
	$(PY) -m ruff check emu toolchain arena openswarm tests bench setup.py
	@mkdir -p build
	@$(PY) -m mypy $(TYPED) >build/types 2>&1 & types=$$!; \
	$(PY) -m pytest -n auto --dist worksteal tests $(PYTEST); tests=$$?; \
	wait $$types; types=$$?; cat build/types; exit $$((tests != 0 || types != 0))

bench: $(STAMP)
	$(PY) -m bench

campaigns: SECONDS = 300
campaigns: JOBS = 1
campaigns: $(STAMP)
	$(PY) -m tests.fuzz --seconds $(SECONDS) --jobs $(JOBS)

site: $(STAMP)
	$(PY) -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	$(PY) docs/tools/site.py --out build/site

# every package of this environment with version and licence, as CycloneDX
sbom: $(STAMP)
	$(PY) -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	mkdir -p build
	$(PY) -m cyclonedx_py environment --pyproject pyproject.toml --output-reproducible -o build/sbom.json $(PY)

$(STAMP): pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed; set PYTHON=...")'
	$(PYTHON) -m venv $(VENV)
	$(PY) -m pip install --quiet --disable-pip-version-check --editable '.[$(EXTRAS)]'
	touch $@

clean:
	rm -rf firmware.elf firmware/build

FORCE:
.PHONY: run test bench campaigns site sbom clean FORCE
