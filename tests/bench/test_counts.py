#!/usr/bin/env python3
"""The containers of generated scenes have exactly the counts and bytes that bench/results.csv states."""
import os
import pathlib
import subprocess
import sys

root = pathlib.Path(os.environ.get("STRL_TEST_ROOT", pathlib.Path(__file__).resolve().parents[2]))
most = "20000" if b"__asan_init" in pathlib.Path(sys.argv[1]).read_bytes() else "500000"
command = [sys.executable, root / "bench" / "counts.py", "--stroll", sys.argv[1], "--most", most]
sys.exit(subprocess.run(command).returncode)
