# `make demo` and `make test` do all set-up on a fresh machine with Python 3.11 or newer.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# a module of ours, of which an error that is meant for a user is a line
RUN := $(BIN)/python -m tests.support.target
# the tests start Python some thousand times, and each start would compile our modules anew
export PYTHONDONTWRITEBYTECODE :=

.PHONY: fuzz fuzz-models demo hil-demo test test-untimed test-slow test-slow-part foreign-study hidden-study public-study misuse-study bench-study laws-study extended-study hil-faults hil-faults-all proxy-faults hil-latency soak check benchmark docs docs-version chromium dist clean help

help:
	@echo "make demo       everything once, with pictures and a report in demo-output/"
	@echo "make test       checks and tests"
	@echo "make test-slow  the tests that take longer, and every case of those that have many: nightly, and before a release"
	@echo "make test-slow-part a fifth of them, another one with every commit; PPY_PART=2/5 chooses"
	@echo "make docs       the site in build/site, its notebooks run anew; a warning is an error"
	@echo "make docs-version the site of this version beside those of others in build/versions; ADDRESS=URL where it is served"
	@echo "make fuzz       damaged files to whatever reads files, for ten minutes; SEED=N and SECONDS=N likewise"
	@echo "make hidden-study how often the right cause is named, and a wrong one where nothing is hidden, over hundreds of records; SEED=N draws others"
	@echo "make public-study what is said of public records, beside plain least squares; records where PPY_PUBLIC_DATA says"
	@echo "make misuse-study what is said of records with wrong units, columns, signs, clocks or cuts; SEED=N likewise"
	@echo "make bench-study what is said of benches and stands with an actuator, clean and with what is hidden; SEED=N likewise"
	@echo "make laws-study whether the law is found that lacks what no catalogue has; SEED=N likewise"
	@echo "make extended-study models extended by what their diagnosis names, asked again as FMUs; SEED=N likewise"
	@echo "make foreign-study what is told of FMUs without equations; SEED=N likewise"
	@echo "make fuzz-models models and records drawn at random, diagnosed; SEED=N and CASES=N likewise"
	@echo "make hil-demo   a rig measured, diagnosed, and the extended model run beside it; a page in hil-output/"
	@echo "make hil-faults whatever can fail between a client and its rig, brought about"
	@echo "make proxy-faults what masters read of a proxy whose rig fails"
	@echo "make hil-faults-all every combination of failures and signals, for three quarters of an hour"
	@echo "make soak       ten minutes at 100 Hz beside a hostile peer: memory and descriptors must stay flat; SECONDS=60 for a quick look"
	@echo "make hil-latency the rig's server beside a bare ZeroMQ echo"
	@echo "make benchmark  speed, as ratios measured in one run"
	@echo "make dist       wheel and source distribution in dist/, FMUs of FMI 2.0 and 3.0 and systems for all platforms in dist/release/, run in every tool that is here"

demo: $(VENV)/installed
	$(BIN)/ppy demo --out demo-output

# what is about milliseconds comes afterwards: beside a suite that uses every core its deadlines are missed
test:
	$(MAKE) -j 2 --no-print-directory check test-untimed chromium
	$(BIN)/pytest -n 2 --dist loadfile -m "not slow and real_time" $$(grep -rl --include='test_*.py' real_time tests)

test-untimed: $(VENV)/installed-dev
	$(BIN)/pytest -n 3 --dist loadfile --no-loadscope-reorder -m "not slow and not real_time"

docs: $(VENV)/installed-dev
	$(BIN)/python -m sphinx -W --keep-going -q -c docs/site -d build/doctrees . build/site

docs-version: $(VENV)/installed-dev
	$(RUN) docs.site.versions $(if $(ADDRESS),--address $(ADDRESS))

fuzz: $(VENV)/installed-dev
	$(RUN) tests.support.fuzz --seconds $(or $(SECONDS),600) --seed $(or $(SEED),0)

fuzz-models: $(VENV)/installed-dev
	$(RUN) tests.support.fuzz_models --cases $(or $(CASES),2000) --seed $(or $(SEED),0)

test-slow: $(VENV)/installed-dev chromium
	$(BIN)/pytest -n 3 --dist loadfile --no-loadscope-reorder -m slow

# the slow tests in five parts, another one with every commit: red is seen after five at the latest
test-slow-part: export PPY_PART ?= $(shell expr $$(git rev-list --count HEAD 2>/dev/null || date +%j) % 5 + 1)/5
test-slow-part: test-slow

public-study: $(VENV)/installed-dev
	$(RUN) studies.judging.public

hidden-study: $(VENV)/installed-dev
	$(RUN) studies.judging.hidden --records 120 --two 16 --terms 40 --rig 46 --clean 120 --seed $(or $(SEED),20270110) --out docs/hidden-records.md

misuse-study: $(VENV)/installed-dev
	$(RUN) studies.judging.misuse --each 2 --seed $(or $(SEED),20261181) --out docs/misused-records.md

bench-study: $(VENV)/installed-dev
	$(RUN) studies.judging.bench --records 10 --seed $(or $(SEED),20261186) --out docs/bench-records.md

laws-study: $(VENV)/installed-dev
	$(RUN) studies.judging.laws --records 22 --clean 8 --seed $(or $(SEED),60260713) --without VoiceCoil --out docs/hidden-laws.md

extended-study: $(VENV)/installed-dev
	$(RUN) studies.judging.extended --records 30 --seed $(or $(SEED),20271)

foreign-study: $(VENV)/installed-dev
	$(RUN) studies.judging.foreign --records 16 --clean 12 --seed $(or $(SEED),20261165) --out docs/foreign-fmus.md

hil-demo: $(VENV)/installed
	$(BIN)/ppy rig demo --out hil-output

soak: $(VENV)/installed-dev
	$(RUN) benchmarks.rig_soak --seconds $(or $(SECONDS),600)

proxy-faults: $(VENV)/installed-dev
	$(RUN) tests.support.rig.masters

hil-faults: $(VENV)/installed-dev
	$(RUN) tests.support.rig.faults

hil-faults-all: $(VENV)/installed-dev
	$(RUN) tests.support.rig.faults --all

hil-latency: $(VENV)/installed-dev
	$(RUN) benchmarks.rig_latency

check: $(VENV)/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

benchmark: $(VENV)/installed-dev
	$(RUN) benchmarks

dist: $(VENV)/installed-dev
	rm -rf dist
	$(BIN)/python -m build --outdir dist .
	$(RUN) studies.release.folder --out dist/release
	$(RUN) tests.support.compatibility --out dist/release

# The report is looked at in a real browser; without the rights to install one, that test says why it is skipped.
chromium:
	@command -v chromium >/dev/null || command -v google-chrome >/dev/null || \
	  { [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null && apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium fonts-liberation; } || \
	  echo "no chromium here: the browser test will be skipped"

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed; this is " + sys.version.split()[0] + " (set PYTHON=...)")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/installed: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[standard]'
	@touch $@

$(VENV)/installed-dev: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@ $(VENV)/installed

clean:
	rm -rf $(VENV) demo-output build dist *.egg-info
