# make          builds build/stroll
# make demo     installs what is missing, builds, makes the demo model and walks through it
# make install  builds and installs: make install PREFIX=/usr DESTDIR=/tmp/stage
# make test     installs what is missing and runs the whole suite
# make format   lays all C out as .clang-format says; make format-check only looks
# make clean

PREFIX ?= /usr/local

.PHONY: all build deps demo install test format format-check clean

all: build

build:
	@tools/install-deps --check build
	@cmake --preset release --log-level=WARNING
	@cmake --build build --target stroll

deps:
	@tools/install-deps

demo:
	@tools/install-deps build run
	@$(MAKE) --no-print-directory build
	@tools/demo

install:
	@tools/install-deps --check build
	@cmake --preset release --log-level=WARNING -DCMAKE_INSTALL_PREFIX=$(PREFIX)
	@cmake --build build --target stroll_package
	@cmake --install build

test: deps
	@python3 tools/run_tests.py

format:
	@git ls-files '*.c' '*.h' '*.cpp' | xargs clang-format -i

format-check:
	@git ls-files '*.c' '*.h' '*.cpp' | xargs clang-format --dry-run --Werror

clean:
	rm -rf build demo
