# Everything that is made lands in build/, but for the virtual environment: .venv.
# make ... ARGS='...' passes options on to the program that a target starts.

.DEFAULT_GOAL := help
.PHONY: help setup packages run codec wheels wheels-test import-check docs reference test fresh test-binary test-binary-directory test-binary-file check arcs mutants portable fuzz truth dialects \
	bench bench-station bench-json bench-messages bench-v2n bench-time bench-record bench-ros2 bench-before lab meter attack chaos outages client facilities fleet swarm \
	kernel ros2 clock days chronyd binary deb deb-test image image-test image-conventions programs programs-test release flash lock proof clean

# The last commit before the code lay in packages, whose figures tests/bench/FIGURES.md has.
BEFORE ?= d0166e94

PYTEST := .venv/bin/python -m pytest

# The targets of `make help`, by group; ALL=1 has the others as well, each with its options.
USE := packages setup run lab meter
TOOLS := codec wheels docs deb programs image flash
DEVELOP := test check reference fresh bench proof clean

help: ## targets by group; ALL=1 shows all of them with their options
	@awk -f .ci/help -v use="$(USE)" -v tools="$(TOOLS)" -v develop="$(DEVELOP)" -v all="$(ALL)" $(MAKEFILE_LIST)

setup: ## install the command .venv/bin/captain, with the messages
	@.ci/setup run
	@.ci/codec
	@.ci/sim

packages: ## install the Debian packages of run and test; for users without root: sudo make packages
	@.ci/setup packages

run: setup ## two simulated stations and what their users receive; Ctrl-C ends it
	@.venv/bin/captain demo $(ARGS)

codec: setup ## build the Python module of all messages; in build/codec, with those that captain-asn1 has added

wheels: setup ## build captain-client and captain-messages for other Pythons; in build/wheels; ARGS='cam-1.4.1' for some messages
	@.ci/wheels $(ARGS)

wheels-test: setup-image ## both wheels in new Debian 12 and 13 roots, as root: Python 3.11 and 3.13, offline; after make wheels
	@.venv/bin/python -m tests.programs.wheels $(ARGS)

import-check: setup-test ## do the modules of the standards in ASN1=DIR give the committed schema and the same codecs?
	@[ -n "$(ASN1)" ] || { echo "make import-check ASN1=DIR: the directory with the modules" >&2; exit 2; }
	@.venv/bin/captain-asn1 import-check "$(ASN1)"

test: setup-test ## all tests, against the source
	@.venv/bin/python -m tests $(ARGS)

fresh: ## run and test on bare Debian 12 and 13, as root; in new roots, with times and sizes; ARGS=bookworm
	@.ci/setup fresh
	@.ci/fresh $(ARGS)

test-binary: test-binary-directory test-binary-file ## the system tests against both forms of the binary; -j2 -O: side by side; ONE_FILE='FILES' of tests for the one file

test-binary-directory: setup-test binary
	@CAPTAIN=build/binary/captain-dir/captain $(PYTEST) tests/system $(ARGS)

test-binary-file: setup-test binary
	@CAPTAIN=build/binary/captain $(PYTEST) $(or $(ONE_FILE),tests/system) $(ARGS)

check: setup-test ## lint, format, types, imports, construction, plain English
	@.venv/bin/ruff check
	@.venv/bin/ruff format --check
	@.venv/bin/mypy
	@.venv/bin/mypy --python-version 3.10 -p captain_client
	@$(PYTEST) tests/test_imports.py
	@.ci/structure
	@.ci/construction
	@.ci/words

portable: setup-portable ## C with gcc, clang and for aarch64 (run by qemu): the library, built, installed, linked, run; the simulated radio; the C++ client
	@CAPTAIN_PORTABLE=1 $(PYTEST) tests/asn1/backends/cmake/test_library.py tests/drivers/som301e/test_process.py tests/firmware/captain_client/cpp $(ARGS)

reference: setup ## write firmware/reference from the code
	@.venv/bin/python -m tests.reference

docs: setup setup-docs ## build a site of all documents and messages; in build/docs, with search; needs no server
	@.ci/site

fuzz: setup-fuzz ## random octets, led by coverage, for every message in C and in Python; ARGS='--runs 10000000'
	@.venv/bin/python -m tests.fuzz $(ARGS)

bench: bench-station bench-json bench-messages bench-v2n bench-time bench-record bench-ros2 ## all measurements; the targets bench-*

bench-station: setup-test binary ## latency, loss-free rate, processor and memory beside a C forwarder in the same run
	@.venv/bin/python -m tests.bench $(ARGS)

bench-json: setup-test ## a CAM as JSON beside its octets, to the radio and to users: latency, highest rate, memory; JSON='--pairs 2'
	@.venv/bin/python -m tests.bench.json_path $(JSON)

bench-messages: setup-test ## the message library beside asn1tools, pycrate and asn1c in the same run, and how large it is; MESSAGES='--only cam'
	@.venv/bin/python -m tests.bench.messages $(MESSAGES)
	@.venv/bin/python -m tests.bench.sizes

bench-v2n: setup-test ## cost of a broker in trouble for other interfaces; V2N beside plain paho; V2N='--pairs 2'
	@.venv/bin/python -m tests.bench.v2n $(V2N)

bench-time: setup-test ## cost of pulses and time for a station and its messages; TIME='--pairs 2'
	@.venv/bin/python -m tests.bench.time_path $(TIME)

bench-record: setup-test ## cost of the recorder and the meter; a disk that is full or gone; RECORD='--pairs 2'
	@.venv/bin/python -m tests.bench.record $(RECORD)

bench-ros2: setup-ros2 ## UPER to ROS 2's CDR and back beside typed messages and asn1tools with rosbags; the gateway; ROS2='cam-1.4.1' GATEWAY='--duration 2'
	@.ci/ros2
	@.venv/bin/python -m tests.bench.ros2 $(ROS2)
	@.venv/bin/python -m tests.bench.gateway $(GATEWAY)

bench-before: setup-test binary ## this tree beside an earlier commit: link to indication, start and size of the binaries; BEFORE=COMMIT
	@.venv/bin/python -m tests.bench.before $(BEFORE) $(ARGS)

arcs: setup-test ## the branches that the tests take, folder by folder, beside an earlier commit; BEFORE=COMMIT ARGS=--names
	@.venv/bin/python -m tests.cover.arcs $(BEFORE) $(ARGS)

mutants: setup-test ## 500 small mistakes in a folder: how many the tests notice, beside an earlier commit; BEFORE=COMMIT ARGS='pps'
	@.venv/bin/python -m tests.cover.mutants --before $(BEFORE) $(or $(ARGS),firmware/card)

truth: setup-test ## compare our codec with others on generated messages, and each edition with the others; ARGS='--count 1000000'
	@.venv/bin/python -m tests.asn1.truth $(ARGS)

dialects: setup-test ## generated messages through both dialects of JSON, and their schemas; ARGS='--count 100000'
	@.venv/bin/python -m tests.firmware.codec.dialects $(ARGS)

lab: setup-test ## ten messages at 10 Hz between two stations; over UDP, raw Ethernet, radios, a broker, both at once; 60 s each
	@mkdir -p build
	@.venv/bin/captain lab --capture build/lab-udp.pcap --decode $(ARGS)
	@.venv/bin/captain lab --capture build/lab-ethernet.pcap --decode --veth $(ARGS)
	@.venv/bin/captain lab --capture build/lab-radio.pcap --decode --radio $(ARGS)
	@.venv/bin/captain lab --mqtt $(ARGS)
	@.venv/bin/captain lab --capture build/lab-both.pcap --decode --radio --mqtt $(ARGS)

meter: setup-test ## loss, delay and age: measured and injected; with the tables of the paper; pages in build/meter-*.html
	@mkdir -p build
	@rm -f build/meter-table[13].*
	@.venv/bin/captain meter table1 --report build/meter-table1.html $(ARGS)
	@.venv/bin/captain meter table3 --report build/meter-table3.html $(ARGS)

attack: setup-test binary ## hostile peers at all four ports at once for 60 s: the loop's lag beside a quiet minute; ARGS='--duration 10'
	@.venv/bin/python -m tests.attack $(ARGS)

chaos: setup-test ## everything that is simulated fails at random: MINUTES=30 of virtual time, then DURATION=600 real seconds
	@.venv/bin/python -m tests.proof.chaos.virtual --minutes $(or $(MINUTES),30) --seeds 1 2 3
	@.venv/bin/python -m tests.proof.chaos --duration $(or $(DURATION),600) $(ARGS)

outages: setup-test ## a vehicle's network: HOURS=24 of it in virtual time, then DURATION=1800 real seconds without the quiet; SEEDS='1 2 3'
	@.venv/bin/python -m tests.proof.outage.virtual --hours $(or $(HOURS),24) --seeds $(or $(SEEDS),1 2 3)
	@.venv/bin/python -m tests.proof.outage --duration $(or $(DURATION),1800) $(ARGS)

client: setup-test ## the Python client while the station is restarted: exact sums of requests and messages; ARGS='--duration 8 --restarts 2'
	@.venv/bin/python -m tests.proof.client $(ARGS)

facilities: setup-test ## requests in JSON while the facilities process is killed: one outcome each; ARGS='--requests 200 --kills 3'
	@.venv/bin/python -m tests.proof.facilities $(ARGS)

fleet: setup-test ## V2N of 1,000 to 100,000 vehicles: messages by tile, broker, vehicle; measured at two brokers: DURATION=20
	@.venv/bin/python -m tests.proof.fleet --duration $(or $(DURATION),20) $(ARGS)

swarm: setup-test ## 200 virtual stations at 10 Hz through one station, each message seen: DURATION=600; then past the ceiling
	@.venv/bin/python -m tests.proof.swarm --duration $(or $(DURATION),600) $(ARGS)

kernel: setup-kernel ## our code on Debian's kernel in an emulated computer: 802.11p, GPIO, I2C, PPS, USB; ARGS='--only air'
	@.ci/kernel
	@.venv/bin/python -m tests.proof.kernel $(ARGS)

ros2: setup-ros2 ## the message packages in a real ROS 2: hashes, colcon, rclpy; ARGS='--short', ARGS='--only hashes'
	@.ci/ros2
	@.venv/bin/python -m tests.proof.ros2 $(ARGS)

clock: setup-clock ## time in emulated computers whose pulses this one times, chronyd steering; ARGS='--only pulses'
	@.ci/clock
	@.venv/bin/python -m tests.proof.clock $(ARGS)

days: setup-test ## a day of each fault of pulses and receivers in virtual time, then DAYS=365 of all as chance has it
	@.venv/bin/python -m tests.pps.days --days $(or $(DAYS),365) $(ARGS)

chronyd: setup-test ## a real chronyd, fed and stepped: by the refclock alone, then by a running station; 2 minutes
	@.venv/bin/python -m tests.pps.chronyd_check
	@.venv/bin/python -m tests.pps.chronyd_steps

binary: setup-freeze setup ## build captain as one file and as a directory; in build/binary; the directory is for the image
	@.ci/freeze

deb: setup-deb setup wheels ## build the Debian packages and wheels for this processor; in build/deb, without root
	@.venv/bin/python -m image.program.native

deb-test: setup-image $(if $(findstring --made,$(ARGS)),,deb) ## the packages in new Debian 12 and 13 roots, as root; ARGS='--suites bookworm', ARGS='--made build/programs --arch arm64'
	@.ci/emulation
	@.venv/bin/python -m tests.programs.packages $(ARGS)

image: setup-image ## build the card of a Raspberry Pi 4; build/captain-VERSION-arm64.img, checked; ARGS='build --upgrade', ARGS=twice
	@.ci/image $(ARGS)

programs: setup-image ## build captain as one file and the Debian packages; for Debian 12 and later, amd64 and arm64; in build/programs
	@.ci/image programs $(ARGS)

programs-test: setup-image ## the same in new Debian 12 and 13 roots: installed by apt, run, measured; ARGS=--short for Debian 12 alone
	@.ci/image programs
	@.venv/bin/python -m tests.programs $(ARGS)

release: setup-image ## all files of a release, in build/release: card, update, binaries, Debian packages, containers, checksums; KEY=FINGERPRINT signs the apt repository
	@.ci/image release $(if $(KEY),--key "$(KEY)") $(ARGS)

image-test: setup-image ## the card in QEMU, part by part, looked at from outside; ARGS='--only start ports', ARGS=--short
	@.venv/bin/python -m tests.proof.image $(ARGS)

image-conventions: setup-test ## the files for Raspberry Pi Imager, cloud-init, rpi-image-gen and pi-gen, by our tests; with MIRRORS=DIR, checkouts of rpi-imager, rpi-image-gen and pi-gen, also by their schema, lint and runner
	@.venv/bin/python -m tests.image.conventions $(if $(MIRRORS),--mirrors "$(MIRRORS)") $(ARGS)

flash: setup-image ## write the card, after a question: DEV=/dev/sdX
	@[ -n "$(DEV)" ] || { echo "flash: no card is named: DEV=/dev/sdX; lsblk lists them" >&2; exit 2; }
	@.ci/image flash -- "$(DEV)"

lock: ## lock the newest versions that pyproject.toml allows; with hashes
	@.ci/lock

proof: ## all tests and measurements, 4 hours; on two cores; ASN1=DIR checks the import as well
	@ASN1="$(ASN1)" .ci/run full

clean: ## remove build/ and the caches; .venv stays
	@rm -rf build .mypy_cache .ruff_cache .hypothesis
	@find . -path ./.venv -prune -o -name __pycache__ -type d -exec rm -rf {} +

setup-freeze setup-deb:
	@.ci/setup $(@:setup-%=%)

setup-%:
	@.ci/setup $*
	@.ci/codec
	@.ci/sim
