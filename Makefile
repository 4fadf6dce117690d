# make setup   install everything into .venv (needs Python 3.11 or newer, no root) and compile it
# make demo    the live demonstration; options in ARGS, such as ARGS="siso --out out/siso"
# make test    linters, types and tests; pytest's options in ARGS
# make lint    linters, types and import contracts alone
# make docs    the documentation site, in out/site; any warning fails
# make clean   remove .venv and all that was built
#
# PYTHON=... names the interpreter of a new .venv; without it python3.12, python3.11 and
# python3 are tried.

.SUFFIXES:
.PHONY: setup demo test lint compiled collected docs clean

VENV := .venv
BIN := $(VENV)/bin
# Empty files that tell what is installed: the package with what it needs, and everything. They name
# the folder, as an environment that was copied or moved elsewhere does not work there.
HERE := $(subst /,-,$(subst $() $(),-,$(CURDIR)))
CORE := $(VENV)/core$(HERE)
DONE := $(VENV)/installed$(HERE)
# Bytecode is made when a module is first imported, as most modules of the packages never are.
INSTALL := $(BIN)/python -m pip --disable-pip-version-check -qq install --no-compile -c constraints.txt
FAILED := { echo "setup: installation failed; see the lines above, then run make setup again" >&2; exit 1; }
SOURCES := setup.py setup.cfg pyproject.toml package.xml stiction_ros/__init__.py studies/pyproject.toml \
    $(wildcard resource/* launchers/* launch/* config/*)

setup:
	@$(MAKE) --no-print-directory -j2 $(DONE) compiled
	@echo "setup: done, the command is $(BIN)/stiction"

# A first or broken-off installation starts from an empty environment; after that only what
# has changed is installed. The package and its studies are installed editable, so that the
# command and the nodes follow the tree; install_data adds what an editable installation leaves out:
# launchers, marker and config files. $(BIN)/python is missing when its Python has gone.
$(CORE): constraints.txt $(SOURCES) $(if $(realpath $(BIN)/python),,missing)
	@test -e $@ -a -x $(BIN)/python || { $(find-python); \
	    echo "setup: new environment $(VENV) with `$$python --version`"; \
	    $$python -m venv --clear $(VENV) || \
	    { echo "setup: $$python cannot make $(VENV); see the lines above" >&2; exit 1; }; }
	@rm -f $@
	@echo "setup: installing"
	@$(INSTALL) "setuptools<80" wheel && $(INSTALL) --no-build-isolation -e . && \
	$(BIN)/python -W ignore setup.py -q install_data --install-dir $(VENV) || $(FAILED)
	@touch $@

# All other packages; machine code is made meanwhile, as it needs none of them. Both files are made at
# the end: where this is broken off, the next installation starts from an empty environment.
$(DONE): $(CORE)
	@rm -f $(CORE) $@
	@$(INSTALL) --no-build-isolation "stiction_ros[ros,opcua,survey,dask,docs,test]" -e studies || \
	$(FAILED)
	@touch $(CORE) $@

# The first identification and the first gap would compile for a minute; machine code is kept beside
# the modules.
compiled: $(CORE)
	@echo "setup: machine code, a minute at the first time"
	@$(BIN)/python -c "from stiction_ros.identification.warm_up import compile_loops; compile_loops()"
	@$(BIN)/python -c "import stiction_ros as s; loop = s.LoopModel.load(s.find_config('flow.loop.yaml')); \
	    s.find_gap(loop, [s.simulate(loop, samples=600)], s.GapOptions(quick=True))"

.PHONY: missing
missing:

# Leaves in $$python the first interpreter that runs, is new enough and can make environments.
define find-python
fault='no Python found'; \
for python in $(if $(PYTHON),"$(PYTHON)",python3.12 python3.11 python3); do \
    version=`$$python -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null` || \
        { [ -z "$(PYTHON)" ] || fault="$(PYTHON) does not run"; continue; }; \
    $$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
        { fault="$$python is Python $$version"; continue; }; \
    $$python -c 'import ensurepip, venv' 2>/dev/null || \
        { fault="$$python lacks the module venv or ensurepip (package python3-venv)"; continue; }; \
    fault=''; break; \
done; \
[ -z "$$fault" ] || { \
    echo "setup: $$fault; install Python 3.11 or newer with venv, or name it: make setup PYTHON=..." >&2; \
    exit 1; }
endef

demo: setup
	$(BIN)/stiction demo $(ARGS)

lint: $(DONE)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

# Bytecode is kept, as hundreds of processes start in the tests: each would compile all modules anew.
unexport PYTHONDONTWRITEBYTECODE

# Beside the linters, which leave a core for that, machine code is made and the bytecode of the tests:
# all workers would make the same at once. Three of them keep two cores busy, as tests of the nodes
# wait for each other. Files run in order: else those with few tests came last, which are the long ones.
test:
	$(MAKE) -j2 lint compiled collected
	$(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder -m "not alone" $(ARGS)
	$(BIN)/python -m pytest -m alone $(ARGS) || test $$? -eq 5  # 5: ARGS picks none of them

collected: $(DONE)
	@$(BIN)/python -m pytest --collect-only -qq $(ARGS) > /dev/null || true  # the workers say what fails

docs: $(DONE)
	$(BIN)/mkdocs build --strict --clean
	@echo "docs: out/site/index.html"

clean:
	rm -rf $(VENV) build dist install log *.egg-info studies/*.egg-info studies/build .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find stiction_ros studies test examples tools -name __pycache__ -prune -exec rm -rf {} +
