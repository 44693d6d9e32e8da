#!/usr/bin/env python3
"""The containers of generated scenes have exactly the counts and bytes that bench/results.csv states."""
import os
import pathlib
import subprocess
import sys

root = pathlib.Path(os.environ.get("STRL_TEST_ROOT", pathlib.Path(__file__).resolve().parents[2]))
sys.exit(subprocess.run([sys.executable, root / "bench" / "counts.py", "--stroll", sys.argv[1]]).returncode)
