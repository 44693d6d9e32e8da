"""Whether a program was built with sanitizers, which change memory, address space and time, not behaviour."""
import pathlib


def sanitizers(program):
    """Names of those that it has."""
    content = pathlib.Path(program).read_bytes()
    return [name for name in ("asan", "tsan") if b"__" + name.encode() + b"_init" in content]
