#!/usr/bin/env python3
"""`cmake --install` into a folder, which is then moved: programs outside of the tree find the package there by CMake and by
pkg-config, shared and static, in C and C++, and do what tests/consumer/ says.

usage: test_install.py PROGRAM      in the folder of the build"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(os.environ["STRL_TEST_ROOT"])
HEADERS = sorted(path.name for path in (ROOT / "include/stroll").glob("*.h"))


def cached(name):
    found = re.search(rf"^{name}:[A-Z]+=(.*)$", pathlib.Path("CMakeCache.txt").read_text(), re.M)
    return found[1] if found else ""


class Test:
    def __init__(self, program, folder):
        self.program, self.folder, self.failures = program, folder, 0
        self.prefix = folder / "moved"

    def check(self, claim, good, detail=""):
        print(f"{'ok    ' if good else 'FAILED'} {claim}{'' if good else ': ' + str(detail)}", flush=True)
        self.failures += not good

    def run(self, *words, **options):
        environment = {**os.environ, **options.pop("environment", {})}
        result = subprocess.run([str(word) for word in words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                env=environment, **options)
        if result.returncode:
            self.check(" ".join(map(str, words)), False, result.stdout)
        return result.stdout

    # ---- installing

    def installs_and_moves(self):
        first = self.folder / "first"
        self.run("cmake", "--install", ".", "--prefix", first)
        first.rename(self.prefix)
        found = {path.name for path in self.prefix.rglob("*") if path.is_file()}
        version = self.run(self.prefix / "bin/stroll", "--version").split()[1]
        for name in ("libstroll.a", "libstroll_build.a", f"libstroll.so.{version}", f"libstroll_build.so.{version}",
                     "stroll.pc", "stroll-build.pc", "stroll-config.cmake", "stroll-config-version.cmake", "README.md",
                     "stroll.1", "stroll-build.1", "_stroll", "stroll.fish"):
            self.check(f"{name} is installed", name in found, sorted(found))
        headers = sorted(path.name for path in self.prefix.glob("include/stroll/*"))
        self.check("every public header is installed", headers == HEADERS, headers)
        self.version = version
        guide = next(self.prefix.rglob("embedding.md")).parent
        links = set(re.findall(r"\]\(([^)#:]+)\)", (guide / "embedding.md").read_text()))
        missing = [link for link in links if not (guide / link).is_file()]
        self.check("what the guide leads to is installed beside it", links and not missing, missing)
        completion = self.prefix / "share/bash-completion/completions/stroll"
        self.check("completion of bash has the program's name", completion.is_file())

    def honours_destdir(self):
        self.run("cmake", "--install", ".", "--prefix", "/opt/stroll", environment={"DESTDIR": str(self.folder / "stage")})
        self.check("DESTDIR stands before the prefix", (self.folder / "stage/opt/stroll/bin/stroll").is_file())

    def names_no_folder_of_the_build(self):
        secret = {str(ROOT), os.getcwd(), str(self.folder / "first")}
        for path in [*self.prefix.rglob("*.cmake"), *self.prefix.rglob("*.pc")]:
            text = path.read_text()
            self.check(f"{path.name} names no folder of this machine", not any(name in text for name in secret), text)

    # ---- models

    def makes_models(self):
        self.mesh, self.model, self.broken = (self.folder / name for name in ("mesh.ply", "model.stroll", "broken.stroll"))
        self.run(self.program, "scene", "isosurface", "-n", "60K", "-o", self.mesh, "--quiet")
        self.run(self.program, "build", self.mesh, "-o", self.model, "--quiet")
        data = bytearray(self.model.read_bytes())
        data[200] ^= 0x55
        self.broken.write_bytes(data)
        info = self.run(self.program, "info", "--json", self.model)
        self.triangles = int(re.search(r'"triangles": (\d+)', info)[1])

    # ---- consumers

    def runs(self, way, folder, environment):
        out = self.run(folder / "consumer", self.model, self.broken, environment=environment)
        frames = re.findall(r"^frame (\d): (\d+) items, (\d+) triangles, corners good$", out, re.M)
        self.check(f"{way}: ten frames are walked and drawn", len(frames) == 10 and all(int(f[2]) for f in frames), out)
        self.check(f"{way}: the version is the program's", f"version {self.version}\n" in out, out)
        sentence = re.search(r"^broken: bad format: (.*)$", out, re.M)
        named = sentence and str(self.broken) in sentence[1]
        self.check(f"{way}: a broken file is refused with a sentence that names it", named, out)
        out = self.run(folder / "consumer_cpp", self.model, self.broken, environment=environment)
        self.check(f"{way}: C++ opens the model", out.startswith(f"triangles {self.triangles}\nbroken: {self.broken}"), out)
        built = self.folder / "again.stroll"
        out = self.run(folder / "builder", built, self.mesh, environment=environment)
        self.check(f"{way}: the builder builds", out == f"triangles {self.triangles}\n", out)
        self.check(f"{way}: the same bytes as the program's", built.read_bytes() == self.model.read_bytes())

    def builds_by_cmake(self, static):
        way, out = "CMake, static" if static else "CMake", self.folder / f"by-cmake-{static}"
        self.run("cmake", "-S", self.source, "-B", out, f"-DCMAKE_PREFIX_PATH={self.prefix}", f"-DSTATIC={static}",
                 f"-DCMAKE_C_COMPILER={cached('CMAKE_C_COMPILER')}", f"-DCMAKE_CXX_COMPILER={cached('CMAKE_CXX_COMPILER')}")
        self.run("cmake", "--build", out)
        self.runs(way, out, {})

    def builds_by_pkg_config(self, prefix, command):
        pc = next(prefix.rglob("stroll.pc")).parent
        folder = self.folder / command.replace(" ", "")
        shutil.copytree(self.source, folder)
        self.run("make", "-C", folder, f"PKG_CONFIG={command}", environment={"PKG_CONFIG_PATH": str(pc)})
        self.runs(command, folder, {"LD_LIBRARY_PATH": str(pc.parent)})

    def with_archives_alone(self):
        prefix = self.folder / "archives"
        shutil.copytree(self.prefix, prefix, symlinks=True)
        for library in prefix.rglob("*.so*"):
            library.unlink()
        return prefix

    def finds_its_importer(self):
        """The program that reads foreign formats is installed too, and found where both were moved to."""
        if not list(self.prefix.rglob("stroll-import")):
            print("not looked at: whether the importer is found (it was not built: no assimp)")
            return
        mesh = self.folder / "mesh.off"
        mesh.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
        out = self.folder / "from-off.stroll"
        self.run(self.prefix / "bin/stroll", "build", mesh, "-o", out, "--quiet")
        self.check("the importer is found in the moved folder", out.is_file())

    def refuses_another_version(self):
        text = self.folder / "another"
        text.mkdir()
        (text / "CMakeLists.txt").write_text("cmake_minimum_required(VERSION 3.22)\nproject(other C)\n"
                                             "find_package(stroll 0.0 QUIET)\nmessage(\"found <${stroll_FOUND}>\")\n")
        out = self.run("cmake", "-S", text, "-B", text / "build", f"-DCMAKE_PREFIX_PATH={self.prefix}")
        self.check("another minor version is not taken for this one", "found <0>" in out, out)

    def all(self):
        self.source = self.folder / "consumer"
        shutil.copytree(ROOT / "tests/consumer", self.source) # nothing beside it leads back into the tree
        self.installs_and_moves()
        self.honours_destdir()
        self.names_no_folder_of_the_build()
        self.makes_models()
        for static in ("OFF", "ON"):
            self.builds_by_cmake(static)
        self.builds_by_pkg_config(self.prefix, "pkg-config")
        self.builds_by_pkg_config(self.with_archives_alone(), "pkg-config --static")
        self.finds_its_importer()
        self.refuses_another_version()


def main():
    if cached("STRL_SANITIZE"):
        print("skipped: what is built with sanitizers does not link into a program that is not")
        return 77
    with tempfile.TemporaryDirectory(prefix="stroll-install-") as folder:
        test = Test(os.path.abspath(sys.argv[1]), pathlib.Path(folder))
        test.all()
    return 1 if test.failures else 0


if __name__ == "__main__":
    sys.exit(main())
