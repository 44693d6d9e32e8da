#!/usr/bin/env python3
"""The models of the data folder that these readers read: built within the root's bound, nothing lost. Those of more
than 300 K triangles only where STRL_LONG_TESTS is set."""
import os
import sys
import tempfile

from building import MIB, build, check_result, data_folder, models, sanitizers, skip, unpack

ENDINGS = (".ply", ".stl", ".obj")
LARGE_BYTES = (2.5 if sanitizers() else 8) * MIB # of an unpacked file, which has 200 K to 300 K triangles then


def main():
    folder = data_folder()
    paths = models(folder, ENDINGS)
    if not paths:
        skip(f"there is no model in {folder}")
    tried = failed = 0
    with tempfile.TemporaryDirectory() as work:
        for path in paths:
            source = unpack(path, work) if path.endswith(".zst") else path
            large = os.path.getsize(source) > LARGE_BYTES
            if not large or os.environ.get("STRL_LONG_TESTS"):
                tried += 1
                failed += not try_model(source, os.path.join(work, "out.stroll"))
            if source != path:
                os.remove(source)
    print(f"{tried} models, {failed} failed")
    return 1 if failed or not tried else 0


def try_model(source, output):
    try:
        result = build(source, output, "--memory", "256M", timeout=900)
        check_result(result)
    except AssertionError as error:
        print(f"{os.path.basename(source)}: {error}", flush=True)
        return False
    print(f"{os.path.basename(source)}: {result['triangles_in']} triangles, root {result['root_triangles']}, "
          f"{result['bytes_out'] / result['triangles_leaf']:.1f} bytes and "
          f"{result['scratch_bytes'] / result['triangles_in']:.0f} of scratch a triangle, "
          f"{result['peak_rss_bytes'] / MIB:.0f} MiB, {result['seconds']:.1f} s, "
          f"{result['triangles_in'] / result['seconds'] / 1e6:.2f} M a second", flush=True)
    return True


sys.exit(main())
