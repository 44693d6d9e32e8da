# make          builds build/stroll
# make demo     installs what is missing, builds, makes the demo model and walks through it
# make test     installs what is missing and runs the whole suite
# make format-check, make clean

.PHONY: all build deps demo test format-check clean

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

test: deps
	@python3 tools/run_tests.py

format-check:
	@git ls-files '*.c' '*.h' '*.cpp' | xargs clang-format --dry-run --Werror

clean:
	rm -rf build demo
