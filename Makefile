# The first command, `make run`, goes from a fresh clone to a picture. `make help` lists the others.
SCENE ?= pyramid
BIN := .venv/bin
export PYTHON

.PHONY: run test film bench gallery validation docs setup lock clean help

run:  ## set up, then render the scene to out/pyramid.png (SCENE=road for another one)
	@tools/setup
	@mkdir -p out
	@$(BIN)/nigemizu render $(SCENE) -o out/$(SCENE).png

test:  ## set up, then check format, lint, types and run the tests
	@tools/setup --dev
	@$(BIN)/python -m ruff format --check --quiet .
	@$(BIN)/python -m ruff check --quiet .
	@$(BIN)/python -m mypy
	@$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadfile $(PYTEST)

film:  ## set up, then render the film of the hot road to out/road.mp4
	@tools/setup
	@mkdir -p out
	@$(BIN)/nigemizu animate road -o out/road.mp4

bench:  ## set up, then measure the speed of each stage on this machine
	@tools/setup
	@$(BIN)/nigemizu bench

gallery:  ## set up, then render again every picture of the README and the documentation
	@tools/setup
	@tools/gallery

validation:  ## set up, then compute again the flows and films of the validation pages (a quarter of an hour)
	@tools/setup
	@cd docs && ../$(BIN)/python -m generators.convection_runs
	@cd docs && ../$(BIN)/python -m generators.arrival_films

docs:  ## set up, then build the documentation in docs/_build/html
	@tools/setup --dev
	@$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

setup:  ## make .venv, with all that the tests and the documentation need
	@tools/setup --dev

lock:  ## resolve the dependencies of pyproject.toml again (needs uv; UPGRADE=1 takes the newest)
	@tools/lock $(if $(UPGRADE),--upgrade)

clean:  ## remove what the other commands made, except .venv
	@rm -rf out build dist docs/_build docs/_generated .pytest_cache .mypy_cache .ruff_cache .hypothesis
	@find src tests docs benchmarks examples -name __pycache__ -type d -prune -exec rm -rf {} +

help:  ## show this list
	@sed -n 's/^\([a-z]*\):  ## /\1: /p' Makefile | while IFS=: read -r name what; do printf '  make %-11s%s\n' "$$name" "$$what"; done
