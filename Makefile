# Bunraku from a fresh checkout: `make run` dances, `make test` checks everything. Both build .venv first.

SHELL := /bin/bash
VENV := .venv
BIN := $(VENV)/bin
PICTURE := out/dance.png
DISTRIBUTIONS := . distributions/sim distributions/studio
ARGS ?= --seconds 30
TEST_ARGS ?=
# The box's processor: amd64 (a NUC) or arm64 (a Raspberry Pi).
ARCH ?= amd64
# Empty, or --long: every count of the tests at its full length.
LENGTH ?=
# Test files run beside each other: they own their ports, folders and boxes. One more than there are cores, for many
# wait; four at most, for each may start a box.
WORKERS = $(shell cores=$$(nproc); echo $$((cores < 3 ? cores + 1 : 4)))
BESIDE = --numprocesses=$(WORKERS) --dist=loadfile --no-loadscope-reorder

# Debian 13's clang is 19, Debian 12's is 14.
CLANG := $(if $(filter trixie,$(shell . /etc/os-release 2>/dev/null && echo $$VERSION_CODENAME)),19,14)

# What is needed from the system, as package:command or package:file (where the package brings no command).
DEBIAN_FOR_FIRMWARE := cmake:cmake g++:g++ make:make
DEBIAN_FOR_GL := libgl1-mesa-dri:/usr/lib/*/dri/swrast_dri.so libegl1:/usr/lib/*/libEGL.so.1 \
    libgles2:/usr/lib/*/libGLESv2.so.2 libgbm1:/usr/lib/*/libgbm.so.1
DEBIAN_FOR_TESTS := $(DEBIAN_FOR_FIRMWARE) $(DEBIAN_FOR_GL) liblo-tools:oscdump iproute2:ip \
    ola:olad xvfb:Xvfb chromium-headless-shell:chromium-headless-shell libportaudio2:/usr/lib/*/libportaudio.so.2 \
    libltc11:/usr/lib/*/libltc.so.11 \
    doctest-dev:/usr/include/doctest/doctest.h cppcheck:cppcheck clang-$(CLANG):clang++-$(CLANG) \
    libclang-rt-$(CLANG)-dev:/usr/lib/llvm-$(CLANG)/lib/clang/*/lib/linux/libclang_rt.fuzzer-* \
    gcc-arm-none-eabi:arm-none-eabi-g++ libnewlib-arm-none-eabi:/usr/lib/arm-none-eabi/newlib/nano.specs \
    qemu-system-arm:qemu-system-arm systemd:systemd-analyze shellcheck:shellcheck openssh-client:ssh-keygen \
    openssl:openssl mtools:mcopy dosfstools:mkfs.vfat fdisk:sfdisk kmod:depmod cpio:cpio zstd:zstd

# A box that boots in a container.
DEBIAN_FOR_BOOT := mmdebstrap:mmdebstrap systemd-container:systemd-nspawn squashfs-tools:mksquashfs \
    e2fsprogs:mke2fs openssh-client:ssh-keygen
# Its disk image, and a whole machine in software that starts it.
DEBIAN_FOR_IMAGE := $(DEBIAN_FOR_BOOT) mtools:mcopy dosfstools:mkfs.vfat fdisk:sfdisk \
    $(if $(filter arm64,$(ARCH)),kmod:depmod cpio:cpio xz-utils:xz zstd:zstd qemu-user-static:qemu-aarch64-static, \
        grub-common:grub-mkimage grub-pc-bin:/usr/lib/grub/i386-pc/boot.img \
        grub-efi-amd64-bin:/usr/lib/grub/x86_64-efi/linux.mod)
DEBIAN_FOR_VM := $(DEBIAN_FOR_IMAGE) $(if $(filter arm64,$(ARCH)),qemu-system-arm:qemu-system-aarch64, \
    qemu-system-x86:qemu-system-x86_64 ovmf:/usr/share/ovmf/OVMF.fd)
DEBIAN_FOR_SOAK := $(DEBIAN_FOR_GL) stress-ng:stress-ng rt-tests:cyclictest

FUZZ_SECONDS ?= $(if $(LENGTH),30,5)
MINUTES ?= 60
# The key that signs releases, and the one after it: docs/releases.md.
VERSION = $(shell sed -n 's/^version = "\(.*\)"/\1/p' pyproject.toml)
# All that is built gets the time of the last commit, so that the same commit gives the same bytes.
deb image wheels dist sbom downloads: export SOURCE_DATE_EPOCH := $(or $(SOURCE_DATE_EPOCH),$(shell git log -1 --format=%ct))
SIGNING = $(if $(KEY),--key '$(KEY)') $(if $(NEXT_KEY),--next-key '$(NEXT_KEY)')

.DEFAULT_GOAL := help
.PHONY: help run deb studio firmware firmware-bin test test-quick test-long pytest beside firmware-test \
    firmware-check fuzz fuzz-corpus lint lint-js bench lock clean soak boot-figures image wheels dist sbom downloads test-vm \
    debian-for-image debian-for-vm debian-for-firmware debian-for-tests debian-for-boot debian-for-soak

help: ## show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-13s %s\n", $$1, $$2}' $(MAKEFILE_LIST)
	@echo "  make run ARGS='--seconds 10' passes options on; make run ARGS= dances until Ctrl-C"
	@echo "  make run ARGS=--phone prints a QR code: scan it, and your phone is the sensor"
	@echo "  make test TEST_ARGS='--seed 5 tests/cli' passes options to pytest; test-long is pytest --long"

run: $(VENV)/.ready-to-run ## dance with an emulated sensor, in a window or into a picture
	@mkdir -p $(dir $(PICTURE))
	@$(BIN)/bunraku play --emulate --rehearse $(PICTURE) $(ARGS)

studio: $(VENV)/.ready-to-test ## add what training needs (PyTorch) to the environment

firmware: debian-for-firmware ## build the wearable's firmware for this machine: emulate --firmware runs it
	@$(call build,firmware,wearable)
	@echo "Built build/firmware/libwearable.so"

# tests/quick.txt lists the tests; tests/quick_rules.py fails one that waits or starts other programs.
test-quick: $(VENV)/.ready-to-test-quickly ## style and unit tests, in two minutes: no root, no Debian package
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/python -m pytest -p tests.quick_rules $(BESIDE) @tests/quick.txt $(TEST_ARGS)

test: $(VENV)/.ready-to-test debian-for-boot firmware fuzz ## style, types, contracts, all tests
	@$(MAKE) --no-print-directory --jobs=2 pytest beside

pytest: $(VENV)/.ready-to-test
	@$(BIN)/pytest $(BESIDE) $(LENGTH) $(TEST_ARGS)

beside:  # while tests wait: with what they leave of the processors
	@chrt --idle 0 $(MAKE) --no-print-directory lint firmware-check

test-long: ## the same with every count at its full length: power cuts, fuzzing, random files, property tests
	@$(MAKE) --no-print-directory test LENGTH=--long

PROFILES ?= mkr1000 mkrwifi1010 xiao_esp32s3 nano_esp32

firmware-bin: ## the wearable's images, out/firmware/wearable-BOARD.bin (needs arduino-cli; PROFILES="mkr1000 ...")
	@command -v arduino-cli >/dev/null || { echo "arduino-cli 1.0 or newer is missing: docs/firmware.md" >&2; exit 1; }
	@case "$(PROFILES):$(ESP32_INDEX)" in *esp32*:) echo \
	    "The ESP32's boards need ESP32_INDEX, the address of Espressif's board index: docs/firmware.md" >&2; exit 1 ;; esac
	@rm -rf build/sketch && mkdir -p build/sketch && cp -r firmware/wearable build/sketch/
	@sed -i 's|^\( *\)- platform: esp32:.*|&\n\1  platform_index_url: $(ESP32_INDEX)|' build/sketch/wearable/sketch.yaml
	@for profile in $(PROFILES); do \
	    case $$profile in mkr*) flags="-std=gnu++17 -fno-sized-deallocation" ;; *) flags= ;; esac; \
	    arduino-cli compile --profile $$profile --output-dir build/firmware-bin/$$profile \
	        --build-property "compiler.cpp.extra_flags=$$flags" build/sketch/wearable \
	    && install -D -m 644 build/firmware-bin/$$profile/wearable.ino.bin out/firmware/wearable-$$profile.bin \
	    || exit 1; \
	done

firmware-test: firmware-check fuzz ## the wearable: host tests, analysis, size and stack, emulated board, fuzzing

firmware-check: debian-for-tests firmware
	@echo "Wearable: host tests with sanitizers"
	@$(call build,firmware,core_tests)
	@build/firmware/core_tests --no-intro
	@echo "Wearable: static analysis"
	@cppcheck --std=c++17 --language=c++ --enable=warning,performance,portability --inline-suppr --quiet \
	    --error-exitcode=1 -I firmware/stubs/samd -I firmware/stubs/wifi101 \
	    firmware/wearable/src firmware/host firmware/qemu firmware/fuzz
	@echo "Wearable: for its processor; the sketch against the stubs"
	@$(call build,firmware-m0,sketch budget,-DCMAKE_TOOLCHAIN_FILE=cmake/cortex-m0plus.cmake)
	@echo "Wearable: on an emulated Cortex-M0"
	@$(call build,firmware-m0,dance)

fuzz: debian-for-tests
	@echo "Wearable: fuzzing for $(FUZZ_SECONDS) s"
	@$(call build,firmware-fuzz,all,-DBUNRAKU_FUZZ=ON -DCMAKE_CXX_COMPILER=clang++-$(CLANG))
	@firmware/fuzz/run.sh build/firmware-fuzz $(FUZZ_SECONDS)

fuzz-corpus: debian-for-tests ## fuzz the wearable (FUZZ_SECONDS) and keep the inputs that reach new code
	@$(call build,firmware-fuzz,all,-DBUNRAKU_FUZZ=ON -DCMAKE_CXX_COMPILER=clang++-$(CLANG))
	@firmware/fuzz/run.sh build/firmware-fuzz $(FUZZ_SECONDS) keep

# $(1) the folder under build/, $(2) the target, $(3) how it is configured.
define build
mkdir -p build && cmake -S firmware -B build/$(1) $(3) >build/$(1).log 2>&1 || { cat build/$(1).log; exit 1; }; \
cmake --build build/$(1) --target $(2) --parallel 2 -- --silent --no-print-directory
endef

boot-figures: $(VENV)/.ready-to-test debian-for-boot ## boot the box, break it, cut its power; times in out/boot (root)
	@BUNRAKU_FIGURES=out/boot $(BIN)/pytest tests/boot --long -rs $(TEST_ARGS)

image: debian-for-image deb ## the box's disk image, out/bunraku-amd64.img (ARCH=arm64: a Raspberry Pi's card; root)
	@rm -rf build/image-$(ARCH) && deploy/image/mkroot.sh --arch $(ARCH) --deb out/bunraku_$(VERSION)_$(ARCH).deb build/image-$(ARCH)
	@deploy/image/mkimage.sh build/image-$(ARCH) out/bunraku-$(ARCH).img

test-vm: $(VENV)/.ready-to-test debian-for-vm ## start the image in an emulated machine, break it, cut its power (an hour)
	@[ -f out/bunraku-$(ARCH).img ] || $(MAKE) image ARCH=$(ARCH)
	@BUNRAKU_IMAGE=out/bunraku-$(ARCH).img $(BIN)/pytest tests/vm -rs -s $(TEST_ARGS)

soak: $(VENV)/.ready-to-run debian-for-soak ## the whole box under load and faults for MINUTES; figures and picture in out/soak
	@exec $(BIN)/python -m hw_sim.soak --minutes $(MINUTES) --out out/soak

lint: $(VENV)/.ready-to-test ## only style, types and import contracts
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy --strict -p appliance -p hw_sim -p tools
	@$(BIN)/lint-imports
	@find firmware -name '*.cpp' -o -name '*.h' -o -name '*.ino' | xargs $(BIN)/clang-format --dry-run --Werror

lint-js: node_modules/.ready ## the page's scripts: eslint and the TypeScript compiler (needs Node.js 20 and npm)
	@npm run --silent lint
	@npm run --silent types

node_modules/.ready: package.json package-lock.json
	@command -v npm >/dev/null || { echo "npm is missing. On Debian: sudo apt-get install -y npm" >&2; exit 1; }
	@npm ci --silent
	@touch $@

bench: $(VENV)/.ready-to-test ## the speed of everything that a tick does, as ratios in one run
	@$(BIN)/pytest tests/benchmarks --benchmark-enable --benchmark-only $(TEST_ARGS)

# One environment for both: `make run` installs box, simulation and pictures, `make test` adds torch and the checks. The
# studio is there too: without torch, its commands say what they need.
$(VENV)/bin/python:
	@for python in $(or $(PYTHON),python3.11 python3.12 python3.13 python3); do \
	    if $$python -c 'import sys, ensurepip, venv; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null; \
	    then echo "Building $(VENV) with $$($$python --version)"; $$python -m venv $(VENV); exit; fi; \
	done; \
	echo "Bunraku needs Python 3.11, 3.12 or 3.13 with venv. On Debian: sudo apt-get install -y python3 python3-venv" >&2; \
	exit 1

$(VENV)/.ready-to-run: requirements.txt pyproject.toml $(wildcard distributions/*/pyproject.toml) | $(VENV)/bin/python
	@$(call install,requirements.txt)
	@touch $@

$(VENV)/.ready-to-test: requirements-test.txt $(VENV)/.ready-to-run
	@$(call install,requirements-test.txt)
	@touch $(VENV)/.ready-to-test-quickly $@

# Without PyTorch: a tenth of the download.
$(VENV)/.ready-to-test-quickly: requirements-test.txt $(VENV)/.ready-to-run
	@$(call install,requirements-test.txt,torch)
	@touch $@

# $(1) the lock file, $(2) a package that is left out.
define install
echo "Installing what $(1) names$(if $(2), without $(2)) (the first time takes minutes)" && \
$(BIN)/python -m pip install --quiet --disable-pip-version-check -r <(grep -v '^$(or $(2),#)==' $(1)) && \
$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation $(DISTRIBUTIONS:%=-e ./%)
endef

debian-for-tests:
	@$(call debian,$(DEBIAN_FOR_TESTS))

debian-for-boot:
	@$(call debian,$(DEBIAN_FOR_BOOT))

debian-for-image:
	@$(call debian,$(DEBIAN_FOR_IMAGE))

debian-for-vm:
	@$(call debian,$(DEBIAN_FOR_VM))

debian-for-soak:
	@$(call debian,$(DEBIAN_FOR_SOAK))

debian-for-firmware:
	@$(call debian,$(DEBIAN_FOR_FIRMWARE))

define debian
missing=; for pair in $(1); do probe=$${pair#*:}; \
    case $$probe in /*) compgen -G "$$probe" >/dev/null;; *) command -v $$probe >/dev/null;; esac || \
    missing="$$missing $${pair%%:*}"; done; \
if [ -n "$$missing" ]; then \
    echo "Missing Debian packages:$$missing. Install them with: sudo apt-get install -y$$missing"; \
    [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null && apt-get update -qq && \
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $$missing >/dev/null; \
fi
endef

deb: ## the box's Debian package: out/bunraku_VERSION_ARCH.deb (ARCH=arm64: Pi; KEY=FILE signs it for sticks)
	@deploy/release/make-deb --arch $(ARCH) $(SIGNING)

wheels: $(VENV)/.ready-to-run ## wheels and source distributions of the last commit: box, simulation, studio; out/dist
	@rm -rf out/dist build/dist && mkdir -p out/dist build/dist
	@set -o pipefail; git archive HEAD | tar -C build/dist -xf -
	@umask 022; for each in $(DISTRIBUTIONS); do for kind in sdist wheel; do \
	    (cd build/dist/$$each && "$(CURDIR)/$(BIN)/python" -c \
	        "from setuptools import build_meta as b; b.build_$$kind('$(CURDIR)/out/dist')") \
	        >build/dist.log 2>&1 || { cat build/dist.log; exit 1; }; done; done
	@for sdist in out/dist/*.tar.gz; do rm -rf build/dist/again && mkdir build/dist/again && \
	    tar -C build/dist/again -xf $$sdist && tar -C build/dist/again --sort=name --mtime=@$$SOURCE_DATE_EPOCH \
	        --owner=0 --group=0 --numeric-owner -cf - $$(ls build/dist/again) | gzip -9n >$$sdist.part && \
	    mv $$sdist.part $$sdist || exit 1; done
	@ls out/dist/*

dist: ## everything that a release has, signed, in out/downloads (KEY=FILE; root); the same commit gives the same bytes
	@if command -v arduino-cli >/dev/null; then $(MAKE) --no-print-directory firmware-bin; \
	    else echo "arduino-cli is missing: out/firmware stays as it is (docs/firmware.md)."; fi
	@$(MAKE) --no-print-directory wheels
	@for arch in $(ARCHITECTURES); do $(MAKE) --no-print-directory image ARCH=$$arch || exit 1; done
	@$(MAKE) --no-print-directory sbom downloads

ARCHITECTURES ?= amd64 arm64

sbom: $(VENV)/.ready-to-run ## bills of materials (SPDX) of the packages and images in out/: out/*.spdx.json
	@for deb in out/bunraku_$(VERSION)_*.deb; do arch=$${deb##*_}; [ ! -f $$deb ] || \
	    $(BILL) --arch $${arch%.deb} --of $$deb $$deb.spdx.json || exit 1; done
	@for image in out/bunraku-*.img; do arch=$${image##*-}; [ ! -f $$image ] || \
	    $(BILL) --arch $${arch%.img} --of $$image --debian $${image%.img}.packages $$image.spdx.json || exit 1; done

BILL = $(BIN)/python -m tools.sbom

downloads: ## pack what was built into out/downloads, with signed sums (KEY=FILE)
	@deploy/release/pack-downloads $(SIGNING)

lock: | $(VENV)/bin/python ## choose the newest versions that pyproject.toml allows and pin them
	@rm -rf build && $(BIN)/python -m venv build/lock
	@$(call pin,pictures,requirements.txt,make run: the box and pictures,./distributions/sim)
	@$(call pin,pictures$(comma)test,requirements-test.txt,make test and make bench: everything,$(filter-out .,$(DISTRIBUTIONS)))
	@rm -rf build

comma := ,
PINNED_BY_US := --exclude bunraku --exclude bunraku-sim --exclude bunraku-studio
# $(1) extras of the box, $(2) the lock file, $(3) its title, $(4) other distributions.
define pin
build/lock/bin/python -m pip install --quiet --disable-pip-version-check --upgrade setuptools '.[$(1)]' $(4) && \
{ echo "# $(strip $(3)). Pinned by 'make lock'; change pyproject.toml instead."; \
  build/lock/bin/python -m pip freeze --all --exclude pip $(PINNED_BY_US) | sed 's/+cpu$$//'; } > $(2)
endef

clean: ## remove the environment and everything built, keep what was trained
	rm -rf $(VENV) node_modules build out benchmarks.json *.egg-info .pytest_cache .mypy_cache .ruff_cache \
	    .import_linter_cache .hypothesis .benchmarks
