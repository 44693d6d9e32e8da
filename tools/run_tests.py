#!/usr/bin/env python3
"""Runs the whole suite: what `make test` does once the packages are there.

Four stages: the suite as gcc builds it with warnings as errors; the suite under AddressSanitizer and UBSan; the tests of
threaded modules under ThreadSanitizer; a build by clang as a compile check, and whether all C is laid out as .clang-format
says. Every stage runs, whatever became of the one before it. The last line counts all of them: "N passed, N failed, N skipped".

    tools/run_tests.py [STAGE...] [--jobs N] [--only REGEX]       stages: gcc asan tsan clang
"""
import argparse
import os
import pathlib
import re
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = ROOT / "build"

# Loops over failures, shapes and payloads that put no thread to a use which test_build, test_verify and test_walk do not.
SLOW_UNDER_TSAN = ("test_build_certify", "test_build_faults", "test_build_root", "test_build_cuts", "test_certify",
                   "test_simplify", "test_simplify_shape", "test_pm_spill", "test_verify_payload", "test_container_hostile",
                   "test_walk_built", "test_walk_remote", "test_build_resume", "test_build_texcoords", "test_container",
                   "test_samples_draws", "test_samples_faults", "test_verify_samples", "test_walk_samples", "test_walk_cones",
                   "test_walk_missing")
# What AddressSanitizer's stage leaves to the first one: what runs the program from outside as others do that stay, and long
# builds whose code shorter ones run too.
NOT_UNDER_ASAN = ("test_outputs", "test_guide", "test_curve", "test_view_review", "test_view_window", "test_sentences", "test_failures",
                  "test_build_real_models", "test_real_models", "test_build_certify", "test_build_root", "test_build_texcoords",
                  "test_remote", "test_placements", "test_samples_command", "test_serve_files", "test_serve_limits")
# And what the first one leaves to that: files and requests of which only a sanitizer shows what they do, and all programs of
# ours that call modules (tests/AREA/test_NAME.c) but those above.
UNDER_ASAN = ("test_nasty", "test_gltf", "test_gltf_hostile", "test_serve_hostile")
# Folders of tests/ whose modules start threads or are called from several; none of them needs a GL driver, whose own
# threads ThreadSanitizer cannot see into.
THREADED_AREAS = ("platform", "jobs", "store", "source", "container", "build", "walk", "verify", "serve")

STAGES = {
    "gcc": ("dev", "gcc", "g++", {}),
    "asan": ("asan", "gcc", "g++", {"ASAN_OPTIONS": "allocator_may_return_null=1:intercept_tls_get_addr=0", # gcc 12's tracer dies of drivers' TLS
                                    "UBSAN_OPTIONS": "print_stacktrace=1"}),
    "tsan": ("tsan", "gcc", "g++", {"TSAN_OPTIONS": "halt_on_error=1:second_deadlock_stack=1"}),
    "clang": ("dev", "clang", "clang++", {}),
}
# Nothing of clang's is run: its warnings are the same without optimising.
UNOPTIMISED = ("clang",)
FORMAT_VERSION = "14" # of clang-format: others lay some lines out in another way
FOLDERS = {"gcc": "test", "asan": "asan", "tsan": "tsan", "clang": "clang"}


class Counts:
    def __init__(self):
        self.passed = self.failed = self.skipped = 0

    def add(self, other):
        self.passed += other.passed
        self.failed += other.failed
        self.skipped += other.skipped

    def __str__(self):
        return f"{self.passed} passed, {self.failed} failed, {self.skipped} skipped"


def left_out(stage):
    """Names of tests that the stage leaves to another."""
    if stage == "asan":
        return NOT_UNDER_ASAN
    programs = [path.stem for path in (ROOT / "tests").glob("*/test_*.c")]
    return sorted({*UNDER_ASAN, *programs} - {*NOT_UNDER_ASAN}) if stage == "gcc" else ()


def run(command, environment=None):
    return subprocess.run(command, cwd=ROOT, env={**os.environ, **(environment or {})}).returncode == 0


def threaded_tests():
    return sorted(path.stem for area in THREADED_AREAS for path in (ROOT / "tests" / area).glob("test_*.c")
                  if path.stem not in SLOW_UNDER_TSAN)


def without_address_randomisation():
    """ThreadSanitizer of gcc 12 does not start where the kernel randomises more bits than it expects."""
    command = ["setarch", "-R"]
    try:
        works = subprocess.run(command + ["true"], stderr=subprocess.DEVNULL).returncode == 0
    except FileNotFoundError:
        works = False
    return command if works else []


def build(stage, jobs, targets):
    preset, c_compiler, cxx_compiler, _ = STAGES[stage]
    folder = BUILD / FOLDERS[stage]
    configure = ["cmake", "--preset", preset, "-B", str(folder), "--log-level=WARNING",
                 f"-DCMAKE_C_COMPILER={c_compiler}", f"-DCMAKE_CXX_COMPILER={cxx_compiler}"]
    flags = "-O0" if stage in UNOPTIMISED else "-O2 -g1" # lines for reports, no more: half of what is written and linked
    configure += [f"-DCMAKE_C_FLAGS_RELWITHDEBINFO={flags}", f"-DCMAKE_CXX_FLAGS_RELWITHDEBINFO={flags}"]
    command = ["cmake", "--build", str(folder), "-j", str(jobs)]
    if targets:
        command += ["--target", *targets]
    return run(configure) and run(command)


def count_case(case):
    """One ctest entry is one program; a cmocka program says what became of each of its tests."""
    counts = Counts()
    status = case.get("status", "run")
    output = case.findtext("system-out") or ""
    failed = case.find("failure") is not None or status == "fail"
    if status in ("notrun", "disabled") or case.find("skipped") is not None:
        counts.skipped = 1
        return counts
    counts.passed = len(re.findall(r"^\[ +OK \]", output, re.M))
    counts.failed = len(set(re.findall(r"^\[  (?:FAILED|ERROR)  *\] (?:--- )?(\w+)$", output, re.M)))
    counts.skipped = len(set(re.findall(r"^\[  SKIPPED \] (\w+)$", output, re.M)))
    if failed and counts.failed == 0:
        counts.failed = 1
    if not failed and counts.passed + counts.skipped == 0:
        counts.passed = 1
    return counts


def test(stage, jobs, only):
    folder = BUILD / FOLDERS[stage]
    report = folder / "junit.xml"
    report.unlink(missing_ok=True)
    prefix = without_address_randomisation() if stage == "tsan" else []
    command = prefix + ["ctest", "--test-dir", str(folder), "-j", str(jobs), "--output-on-failure", "--no-tests=error",
                        "--test-output-size-passed", "4000000", "--test-output-size-failed", "4000000",
                        "--output-junit", str(report)]
    if only:
        command += ["-R", only]
    elif left_out(stage):
        command += ["-E", "^(" + "|".join(left_out(stage)) + ")$"]
    good = run(command, STAGES[stage][3])
    counts = Counts()
    if report.exists():
        for case in ElementTree.parse(report).getroot().iter("testcase"):
            counts.add(count_case(case))
    if not good and counts.failed == 0:
        counts.failed = 1
    return counts


def check_format():
    """Whether clang-format would change nothing."""
    counts = Counts()
    try:
        version = subprocess.run(["clang-format", "--version"], capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError) as error:
        version = str(error)
    if not re.search(rf"version {FORMAT_VERSION}\.", version):
        print(f"run_tests: the layout of C is not checked: that takes clang-format {FORMAT_VERSION} ({version.strip()})", file=sys.stderr)
        counts.skipped = 1
    elif run(["make", "format-check"]):
        counts.passed = 1
    else:
        print("run_tests: `make format` lays it out", file=sys.stderr)
        counts.failed = 1
    return counts


def run_stage(stage, options):
    targets, only = [], options.only
    if stage == "tsan":
        targets = threaded_tests()
        if not targets:
            return Counts()
        only = only or "^(" + "|".join(targets) + ")$"
    counts = Counts()
    if not build(stage, options.jobs, targets):
        print(f"run_tests: the build of stage {stage} failed", file=sys.stderr)
        counts.failed = 1
    elif stage == "clang":
        counts.passed = 1
        counts.add(check_format())
    else:
        counts = test(stage, options.jobs, only)
    return counts


def main():
    parser = argparse.ArgumentParser(description="Runs the whole suite.")
    parser.add_argument("stages", nargs="*", metavar="STAGE", help="gcc, asan, tsan, clang; default: all")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--only", help="a regular expression on the tests' names")
    options = parser.parse_args()
    for stage in options.stages:
        if stage not in STAGES:
            parser.error(f"there is no stage {stage}")
    total, lines = Counts(), []
    for stage in options.stages or list(STAGES):
        print(f"==== {stage}", flush=True)
        start = time.monotonic()
        counts = run_stage(stage, options)
        total.add(counts)
        lines.append(f"{stage:6} {counts}  ({time.monotonic() - start:.0f} s)")
    print("\n".join(["====", *lines]))
    print(total)
    return 1 if total.failed or total.passed == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
