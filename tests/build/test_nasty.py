#!/usr/bin/env python3
"""Every file of the nasty archive becomes what nasty.tsv says: a model of so many triangles, an empty one, or a refusal in
this sentence; and whatever it becomes, soon, in little memory, without a signal and with nothing left behind.

usage: test_nasty.py PROGRAM                   checks (STRL_NASTY=EVERY: all files; else under a sanitizer every third)
       test_nasty.py PROGRAM --update          writes the table anew, notes and rows that vary stay; read what changes
       test_nasty.py PROGRAM --compare-assimp  counts what `assimp info` opens and we refuse, and compares the triangles of
                                               all others with `assimp export`"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time

from building import STROLL, data_folder, sanitizers, skip, unpack
from nasty import files_below, look_at, read_table, write_table

IMPORTER = os.path.join(os.path.dirname(STROLL), "stroll-import")
ASSIMP = "assimp 5.2" # what the table's rows of foreign formats are true of
SAMPLE = 3
MOST_REFUSED = 10
MOST_ADDRESS_KIB = 4 << 20


def importer_fits():
    if not os.path.exists(IMPORTER):
        print("foreign formats are not looked at: stroll-import was not built")
        return False
    version = subprocess.run([IMPORTER, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    if ASSIMP not in version:
        print(f"of foreign formats only what holds of every file is checked: the table is of {ASSIMP}, here is {version}")
    return ASSIMP in version


def compare(expected, found):
    """The sentence of what differs; None = nothing."""
    if expected is None:
        return f"{found.file} is not in the table (--update): {found.outcome} {found.result}"
    if found.digest != expected.digest:
        return f"{found.file} is another file than the table's"
    if expected.outcome == "varies" or (found.outcome, found.result) == (expected.outcome, expected.result):
        return None
    return (f"{found.file}: expected\n    {expected.outcome} {expected.result}\n  found\n    {found.outcome} {found.result}")


def check(folder, work):
    table, files, start = read_table(), files_below(folder), time.monotonic()
    missing = sorted(set(table) - set(files))
    assert not missing, f"not in the archive: {missing}"
    whole = os.environ.get("STRL_NASTY") == "EVERY" or not sanitizers()
    fits, has_importer = importer_fits(), os.path.exists(IMPORTER)
    if not has_importer:
        files = [file for file in files if file in table and not table[file].is_foreign()]
    found = look_at(folder, files if whole else files[::SAMPLE], work)
    problems = [row for row in found if isinstance(row, str)]
    rows = [row for row in found if not isinstance(row, str)]
    for row in rows:
        expected = table.get(row.file)
        # Under a sanitizer memory ends in another way.
        free = expected and expected.is_foreign() and (not fits or (sanitizers() and "M of memory" in expected.result))
        difference = None if free else compare(expected, row)
        problems += [difference] if difference else []
    print("\n".join(problems))
    counts = {outcome: sum(row.outcome == outcome for row in rows) for outcome in ("built", "empty", "refused", "side")}
    print(", ".join(f"{count} {outcome}" for outcome, count in counts.items()), f"and {len(problems)} wrong of {len(table)} files "
          f"in {time.monotonic() - start:.0f} s")
    return 1 if problems or counts["built"] < 50 else 0


def update(folder, work):
    table = read_table()
    found = look_at(folder, files_below(folder), work)
    problems = [row for row in found if isinstance(row, str)]
    rows = [row for row in found if not isinstance(row, str)]
    for row in rows:
        old = table.get(row.file)
        row.note = old.note if old else ""
        if old and old.outcome == "varies":
            row.outcome, row.result = old.outcome, old.result
    write_table(rows)
    print("\n".join(problems + [f"{len(rows)} rows"]))
    return 1 if problems else 0


def assimp(words, seconds=60):
    """Exit status and output, within limits: assimp's own command dies of some files."""
    limited = ["sh", "-c", f'ulimit -v {MOST_ADDRESS_KIB}; exec assimp "$@"', "sh", *words]
    try:
        done = subprocess.run(limited, capture_output=True, timeout=seconds)
    except subprocess.TimeoutExpired:
        return None, b""
    return done.returncode, done.stdout


def exported_triangles(path, work):
    """What assimp makes of it with polygons divided and placements applied; None where its command fails."""
    out = os.path.join(work, "exported.obj")
    status, _ = assimp(["export", path, out, "-fobj", "-tri"])
    if status != 0 or not os.path.exists(out):
        return None
    with open(out, "rb") as file:
        count = len(re.findall(rb"^f ", file.read(), re.M))
    os.remove(out)
    return count


def triangles_in(row):
    words = dict(word.split("=") for word in row.result.split()[1:])
    return int(row.result.split()[0]) + sum(int(words.get(kind, 0)) for kind in ("nonfinite", "degenerate"))


def compare_assimp(folder, work):
    if not shutil.which("assimp"):
        skip("there is no assimp command")
    opened, refused, sides, compared, unexplained = 0, [], [], 0, []
    for row in read_table().values():
        path = os.path.join(folder, row.file)
        status, _ = assimp(["info", path, "-r"])
        opened += status == 0
        if status == 0 and row.outcome in ("refused", "side"):
            (refused if row.outcome == "refused" else sides).append(row)
        if status != 0 or row.outcome not in ("built", "empty"):
            continue
        theirs = exported_triangles(path, work)
        compared += 1
        if theirs != triangles_in(row):
            print(f"{row.file}: {triangles_in(row)} triangles here, {theirs} there: {row.note or 'not explained'}")
            unexplained += [] if row.note else [row]
    for row in refused + sides:
        print(f"{row.outcome}: {row.file}: {row.result} {row.note}")
    print(f"assimp info opens {opened} files; {len(refused)} of these are refused, {len(sides)} are no models; the triangles of "
          f"{compared} were compared, {len(unexplained)} differences are not explained")
    return 1 if unexplained or len(refused) > MOST_REFUSED else 0


def main():
    archive = os.path.join(data_folder(), "nasty.tar.zst")
    if not os.path.exists(archive):
        skip(f"there is no {archive}")
    work = {"--update": update, "--compare-assimp": compare_assimp}.get(sys.argv[2], None) if len(sys.argv) > 2 else check
    assert work, f"{sys.argv[2]} is not known: {__doc__}"
    with tempfile.TemporaryDirectory() as archive_folder, tempfile.TemporaryDirectory() as folder:
        return work(unpack(archive, archive_folder), folder)


sys.exit(main())
