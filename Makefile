# Everything that is made lands in build/, but for the virtual environment: .venv.
# make ... ARGS='...' passes options on to the program that a target starts.

.DEFAULT_GOAL := help
.PHONY: help setup run test test-binary check bench lab binary lock proof clean

PYTEST := .venv/bin/python -m pytest

help: ## this text
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 14

setup: ## the command .venv/bin/captain and what it needs
	@.ci/setup run

run: setup ## two simulated stations that talk to each other, and a live table (Ctrl-C ends it)
	@.venv/bin/captain demo $(ARGS)

test: setup-test ## all tests, against the source
	@$(PYTEST) $(ARGS)

test-binary: setup-test binary ## the system tests against both forms of the binary
	@CAPTAIN=build/binary/captain-dir/captain $(PYTEST) tests/system $(ARGS)
	@CAPTAIN=build/binary/captain $(PYTEST) tests/system $(ARGS)

check: setup-test ## lint, format, types, and who may import whom
	@.venv/bin/ruff check
	@.venv/bin/ruff format --check
	@.venv/bin/mypy
	@$(PYTEST) tests/test_imports.py

bench: setup-test binary ## latency, loss-free rate, processor and memory beside a C forwarder in the same run
	@.venv/bin/python -m tests.bench $(ARGS)

lab: setup-test ## ten messages at 10 Hz for 60 s between two stations, by UDP and by raw Ethernet; tshark decodes all
	@mkdir -p build
	@.venv/bin/captain lab --capture build/lab-udp.pcap --decode $(ARGS)
	@.venv/bin/captain lab --capture build/lab-ethernet.pcap --decode --veth $(ARGS)

binary: setup-freeze ## one file to copy by hand and one directory for the image, in build/binary
	@.ci/freeze

lock: ## newest versions of everything that pyproject.toml names, with hashes
	@.ci/lock

proof: ## everything above in full length: about 40 minutes
	@.ci/run full

clean: ## remove build/ and the caches; .venv stays
	@rm -rf build .mypy_cache .ruff_cache .hypothesis
	@find . -path ./.venv -prune -o -name __pycache__ -type d -exec rm -rf {} +

setup-%:
	@.ci/setup $*
