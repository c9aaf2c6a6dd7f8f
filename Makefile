# Everything is set up inside this folder: environment in .venv, workspace in ros2_ws.
PYTHON ?= python3
DRIVE ?=
FAULT ?=
RATE ?= 1.0
PROFILE ?= robust

LEAD ?=

FULL ?=
RECORDED ?= ../shared/data

# Recipes take what a user writes from the environment: a quote in it would end one in a recipe.
export DRIVE FAULT RATE PROFILE LEAD RECORDED

.PHONY: setup replay simulate evaluate bench test soak lint parameters clean

setup:
	@command -v git >/dev/null || { echo "setup: missing: git" >&2; exit 1; }
	@command -v $(PYTHON) >/dev/null || { echo "setup: missing: Python 3.10 to 3.13 ($(PYTHON) not found)" >&2; exit 1; }
	@$(PYTHON) tools/setup.py

replay: setup
	@./run lfd_bringup replay --drive "$$DRIVE" --fault "$$FAULT" --rate "$$RATE" --profile "$$PROFILE" --out out/replay

simulate: setup
	@./run lfd_bringup simulate --lead "$$LEAD" --fault "$$FAULT" --rate $(if $(filter command,$(origin RATE)),"$$RATE",0) --profile "$$PROFILE" --out out/simulate

evaluate: setup
	@./run lfd_replay paper_evaluation --out out/evaluate --recorded "$$RECORDED" $(if $(filter-out 0,$(FULL)),--full)
	@./run lfd_vehicle closed_loop_evaluation --out out/evaluate $(if $(filter-out 0,$(FULL)),--full)

bench: setup
	@tools/in_workspace python benchmarks/run.py --out out/bench $(if $(filter-out 0,$(FULL)),--full)

test: setup
	@tools/test

soak: setup
	@LFD_SOAK=1 tools/test tests/test_breakage.py tests/test_fuzzed_files.py tests/test_container.py -q

lint: setup
	@.venv/bin/ruff check . && .venv/bin/ruff format --check .

parameters: setup
	@tools/in_workspace python tools/write_generated.py

clean:
	rm -rf .venv out ros2_ws/build ros2_ws/install ros2_ws/log
