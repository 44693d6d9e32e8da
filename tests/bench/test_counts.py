#!/usr/bin/env python3
"""The containers of generated scenes have exactly the counts and bytes that bench/results.csv states."""
import os
import pathlib
import subprocess
import sys

root = pathlib.Path(os.environ.get("STRL_TEST_ROOT", pathlib.Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(root / "tests" / "support"))
import sanitized

most = "20000" if sanitized.sanitizers(sys.argv[1]) else "500000"
command = [sys.executable, root / "bench" / "counts.py", "--stroll", sys.argv[1], "--most", most]
sys.exit(subprocess.run(command).returncode)
