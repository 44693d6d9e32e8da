"""Very many clients of one server at once: connections that repeat what a walk asks for, and programs."""
import asyncio
import shutil
import subprocess
import time

import measure

PATIENCE_S = 1800  # against hanging alone


async def connect(number, port):
    """From an address of its own, as clients have."""
    return await asyncio.open_connection("127.0.0.1", port, local_addr=(f"127.0.{1 + number // 250}.{1 + number % 250}", 0))


async def one_client(connection, target, ranges, content):
    """Returns the milliseconds of each request, and the sentence of what failed, or None."""
    milliseconds = []
    reader, writer = connection
    try:
        for first, last in ranges:
            start = time.monotonic()
            writer.write(f"GET {target} HTTP/1.1\r\nHost: bench\r\nRange: bytes={first}-{last}\r\n\r\n".encode())
            head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
            length = next(int(line.split(":")[1]) for line in head.split("\r\n") if line.lower().startswith("content-length:"))
            body = await reader.readexactly(length)
            if not head.startswith("HTTP/1.1 206 ") or body != content[first:last + 1]:
                return milliseconds, head.split("\r\n")[0]
            milliseconds.append(1000 * (time.monotonic() - start))
    except (OSError, asyncio.IncompleteReadError) as error:
        return milliseconds, str(error) or type(error).__name__
    finally:
        writer.close()
    return milliseconds, None


async def all_clients(count, port, *what):
    connections = await asyncio.gather(*(connect(number, port) for number in range(count)))
    start = time.monotonic()
    done = await asyncio.wait_for(asyncio.gather(*(one_client(one, *what) for one in connections)), PATIENCE_S)
    return done, time.monotonic() - start


def replay(port, target, ranges, content, count):
    done, seconds = asyncio.run(all_clients(count, port, target, ranges, memoryview(content)))
    times = [time for one, _ in done for time in one]
    said = [sentence for _, sentence in done if sentence]
    return {"clients": count, "served": count - len(said), "said": said[:1], "seconds": seconds, "requests": len(times),
            "refused": len(said), "request_ms": measure.spread(times),
            "bytes": sum(last + 1 - first for first, last in ranges) * (count - len(said))}


def programs(command, folder, count):
    """`command` and a file for its statistics, so many times at once. Served is who has drawn all of its last image."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    start = time.monotonic()
    words = [str(word) for word in command]
    children = [subprocess.Popen([*words, str(folder / f"{number}.jsonl")], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                for number in range(count)]
    states = [child.wait(PATIENCE_S) for child in children]
    seconds = time.monotonic() - start
    last = [measure.read_lines(folder / f"{number}.jsonl")[-1] for number, state in enumerate(states) if state == 0]
    shutil.rmtree(folder)
    return {"clients": count, "served": sum(line["missing_nodes"] == 0 and line["faults"] == 0 for line in last), "seconds": seconds,
            "retries": sum(line["network"]["retries"] for line in last)}
