"""What the scripts that test the glTF reader share: read_mesh and pack_mesh, which lie beside stroll, as functions."""
import json
import os
import subprocess
import sys
import tempfile
import traceback

import gltf_writer as w

PROGRAMS = os.path.dirname(os.path.abspath(sys.argv[1]))
LEAST = 8 << 20


def read(path, memory=LEAST, scratch=True):
    """All that the reader gives; {"error": sentence} where it refuses."""
    words = [os.path.join(PROGRAMS, "read_mesh"), path, str(memory)]
    done = subprocess.run(words + ([os.path.dirname(path)] if scratch else []), capture_output=True, timeout=600)
    told = done.stderr.decode(errors="replace")
    assert done.returncode in (0, 1) and done.stdout, f"{path}: exit {done.returncode}: {told}"
    result = json.loads(done.stdout)
    assert ("error" in result) == (done.returncode == 1), result
    return result


def pack(*words, data):
    done = subprocess.run([os.path.join(PROGRAMS, "pack_mesh"), *map(str, words)], input=data, capture_output=True,
                          timeout=60)
    assert done.returncode == 0, done
    return done.stdout, done.stderr


def expect(path, triangles, memory=LEAST, exact=True, **members):
    """The triangles, in order, their hash, and whatever else is said of the result."""
    result = read(path, memory)
    assert "error" not in result, f"{path}: {result}"
    assert result["count"] == len(triangles), f"{path}: {result['count']} triangles, expected {len(triangles)}"
    for index, (got, wanted) in enumerate(zip(result["triangles"], triangles)):
        flat = [x for point in wanted for x in point]
        off = max(abs(a - b) for a, b in zip(got["positions"], flat))
        assert off < 1e-6, f"{path}: triangle {index} is {got['positions']}, expected {flat}"
    if exact:
        wanted = w.position_hash(triangles)
        assert result["hash"] == wanted, f"{path}: hash {result['hash']}, expected {wanted}"
    assert result["hint"] == len(triangles) + result["nonfinite"], f"{path}: hint {result['hint']}"
    assert result["bytes_done"] == result["bytes"], result
    for name, value in members.items():
        assert result[name] == value, f"{path}: {name} is {result[name]}, expected {value}"
    return result


def refuse(path, *parts, memory=LEAST, scratch=True):
    result = read(path, memory, scratch)
    assert "error" in result, f"{path} was read, expected a refusal with {parts}"
    sentence = result["error"]
    for part in (*parts, os.path.basename(path)):
        assert part in sentence, f"'{sentence}' does not contain '{part}'"
    assert "\n" not in sentence and not sentence.endswith("."), sentence
    return sentence


def near(got, wanted, tolerance):
    return all(abs(a - b) <= tolerance for a, b in zip(got, wanted))


def run_tests(tests):
    failed = 0
    for test in tests:
        with tempfile.TemporaryDirectory() as folder:
            try:
                test(folder)
                print(f"ok {test.__name__}")
            except Exception:
                traceback.print_exc()
                print(f"FAILED {test.__name__}")
                failed += 1
    sys.exit(1 if failed else 0)
