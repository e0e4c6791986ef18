# Each target does its own set-up: all that is needed is Python and make.
# Another Python: make PYTHON=python3.12 test

PYTHON ?= python3
BIN := .venv/bin
READY := .venv/ready

.PHONY: help demo test test-slow lint docs bench calibration calibration-60 render picture clean

help:
	@echo "make demo         fit the atmosphere of the eclipse of 2022-05-16; the report is in demo/"
	@echo "make test         run the tests"
	@echo "make test-slow    run the tests that take longer"
	@echo "make lint         check style and types"
	@echo "make docs         build the documentation in site/; broken references fail"
	@echo "make bench        measure speed against error, here and of others; rewrites benchmarks/results/"
	@echo "make calibration  fit 500 photographs drawn from the prior: do intervals hold the truth? Takes hours, resumes"
	@echo "make calibration-60  fit 60 of those, as many as can be begun within 31 minutes"
	@echo "make render       render an eclipse to out/eclipse.png"
	@echo "make picture      make the pictures of the README"
	@echo "make clean        remove all that make has made, .venv included"

demo: $(READY)
	$(BIN)/fit_atmosphere --demo --out demo

test: $(READY)
	$(BIN)/pytest --numprocesses 2 --dist loadfile --no-loadscope-reorder

test-slow: $(READY)
	$(BIN)/pytest -m slow

lint: $(READY)
	$(BIN)/ruff check
	$(BIN)/pyright

docs: $(READY)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

bench: $(READY)
	$(BIN)/python -m benchmarks.rays
	$(BIN)/python -m benchmarks.shadow_peers
	$(BIN)/python -m benchmarks.shadow_speed
	$(BIN)/python -m benchmarks.scenes
	$(BIN)/python -m benchmarks.images
	$(BIN)/python -m benchmarks.picture

calibration: $(READY)
	$(BIN)/python -m benchmarks.calibration --rows benchmarks/results/calibration-rows.jsonl

# Not the first hundred, which were looked at while the fit was made.
calibration-60: $(READY)
	$(BIN)/python -m benchmarks.calibration --first 100 --count 60 --minutes 31 --out out/calibration-60

render: $(READY)
	mkdir -p out
	$(BIN)/eclipsejax render 2008-02-21T03:26Z --site 42.73,-73.68 --alpha 4.7e-6 -o out/eclipse.png

picture: $(READY)
	$(BIN)/eclipsejax render 2022-05-16T04:11:30Z --size 320 -o docs/eclipse-2022-05-16.png
	$(BIN)/eclipsejax chart 2008-02-21 --site 42.73,-73.68 -o docs/chart-2008-02-21.png
	$(BIN)/python docs/pictures.py

clean:
	rm -rf .venv out demo site .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Touched last, so that an interrupted installation is taken up again.
$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
	  echo "This needs Python 3.11 or later, which '$(PYTHON)' is not: name one, as in: make PYTHON=python3.12 test" >&2; \
	  exit 1; }
	@echo "Installing into .venv: this takes some minutes, once."
	@$(PYTHON) -m venv .venv
	@$(BIN)/python -m pip install --quiet --editable '.[docs,lint,test]'
	@touch $@
