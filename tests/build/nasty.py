"""What becomes of each file of the nasty archive, and the table in which it is written down (nasty.tsv).

A row: the file, the first 16 digits of its SHA-256, the outcome, the result, a note. Outcomes:

    built    the result is the number of triangles and, where they are not 0, what was left out by kind and the warnings
    empty    the same without a triangle
    refused  the result is the sentence, without the file's name before it
    side     the same of a file that is no model: a material library, an image, a buffer, a text
    varies   built or refused, not the same each time, which the note explains"""
import hashlib
import json
import os
import re
from concurrent.futures import ThreadPoolExecutor

from building import MIB, run, sanitizers

TABLE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "nasty.tsv")
HEAD = "file\tsha256\toutcome\tresult\tnote\n"
UNKNOWN = ("expected a PLY, STL, OBJ or glTF file by its first bytes or its name's ending, or a name's ending that assimp knows, "
           "found one that begins with ")
MOST_SECONDS = 20 * (6 if sanitizers() else 1)
MOST_BYTES = 300 * MIB
OURS = (".ply", ".stl", ".obj", ".gltf", ".glb")
GLTF_1 = "assimp/models/glTF/"
WORKERS = 2


class Row:
    def __init__(self, file, digest, outcome, result, note=""):
        self.file, self.digest, self.outcome, self.result, self.note = file, digest, outcome, result, note

    def line(self):
        return "\t".join((self.file, self.digest, self.outcome, self.result, self.note)) + "\n"

    def is_foreign(self):
        """Whether it is the importer, and so the version of assimp, that it depends on."""
        return self.outcome != "side" and (not self.file.lower().endswith(OURS) or self.file.startswith(GLTF_1))


def read_table():
    with open(TABLE, encoding="utf-8") as file:
        assert file.readline() == HEAD, f"{TABLE} has another head"
        return {row.file: row for row in (Row(*line.rstrip("\n").split("\t")) for line in file)}


def write_table(rows):
    with open(TABLE, "w", encoding="utf-8") as file:
        file.write(HEAD)
        file.writelines(row.line() for row in sorted(rows, key=lambda row: row.file))


def files_below(folder):
    return sorted(os.path.relpath(os.path.join(above, name), folder)
                  for above, _, names in os.walk(folder) for name in names)


def digest_of(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()[:16]


def result_built(done):
    result = json.loads(done.output)
    dropped = result["dropped"]
    assert result["triangles_in"] == result["triangles_leaf"] + dropped["nonfinite"] + dropped["degenerate"], \
        f"the counts do not add up: {done}"
    assert (0 < result["root_triangles"] <= 16384) == (result["triangles_leaf"] > 0), f"no root: {done}"
    warnings = done.error.count("stroll: warning: ")
    assert warnings == done.error.count("\n"), f"more than warnings: {done}"
    words = [str(result["triangles_placed"])]
    words += [f"{kind}={dropped[kind]}" for kind in ("nonfinite", "degenerate", "lines", "points") if dropped[kind]]
    return " ".join(words + ([f"warnings={warnings}"] if warnings else []))


def sentence_of(done, folder, file):
    lines = done.error.strip("\n").split("\n")
    assert done.code == 1 and done.output == "" and len(lines) == 1 and len(lines[0]) > 20, f"no clean refusal: {done}"
    path = os.path.join(folder, file)
    assert lines[0].startswith(f"stroll: {path}"), f"the sentence does not begin with the file: {done}"
    sentence = lines[0][len(f"stroll: {path}"):].replace(folder + "/", "").lstrip(":, ")
    return re.sub(r"\b\d+M of memory", "..M of memory", sentence).replace("\t", " ")


def outcome_of(folder, file, work):
    """Builds it and checks what holds of every file: soon, in little memory, without a signal, with nothing left behind."""
    path, target = os.path.join(folder, file), os.path.join(work, f"{abs(hash(file))}")
    os.mkdir(target)
    out = os.path.join(target, "out.stroll")
    done = run("build", path, "-o", out, "--json", "--memory", "128M", "--jobs", "1", timeout=MOST_SECONDS)
    assert sanitizers() or done.peak_bytes < MOST_BYTES, f"too much memory: {done}"
    left = os.listdir(target)
    assert left == (["out.stroll"] if done.code == 0 else []), f"left {left}: {done}"
    if done.code == 0:
        os.remove(out)
        result = result_built(done)
        return "empty" if result.split()[0] == "0" else "built", result
    sentence = sentence_of(done, folder, file)
    is_side = UNKNOWN in sentence or sentence.startswith("expected a mesh, found ") and "an empty file" not in sentence
    return "side" if is_side else "refused", sentence.replace(UNKNOWN, "{unknown} ")


def look_at(folder, files, work):
    """A row for each file, in order, or the sentence of what is wrong with it."""
    def one(file):
        try:
            return Row(file, digest_of(os.path.join(folder, file)), *outcome_of(folder, file, work))
        except AssertionError as error:
            return f"{file}: {error}"
    with ThreadPoolExecutor(WORKERS) as pool:
        return list(pool.map(one, files))
