#!/usr/bin/env python3
"""Measures morphs by URL under load, with nginx serving the same file beside the daemon; writes docs/bench-by-url.md.

    tests/bench/by_url_load.py [--bin build/bin] [--seconds 5] [--repeat 3] [--out docs/bench-by-url.md]

The morph is that of tests/samples: dog and giraffe with their landmarks. nginx has as many workers as the daemon has
threads for connections, and sendfile. wrk alternates between both; a row takes the medians of the repeats. For the last
rows two jobs run that do not end. Exit status 1 if a goal is missed. Standard library only; needs wrk and nginx.
"""
import argparse
import asyncio
import gzip
import hashlib
import hmac
import http.client
import json
import os
import pathlib
import random
import re
import resource
import socket
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.parse
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "tests/samples"
CONNECTIONS = 64
RATIO_LEAST = 0.9
P99_MOST_MS = 5.0
VISITS = 4000  # of the rows with one visitor at a time
CROWD_PAUSE_S = 0.1  # of each of the visitors at once
CROWD_S = 6
OTHERS = {"small.glb": "&tolerance=0.003", "large.glb": "&remesh=overlay&normals=false"}
ENDLESS = {"step": 0.01, "growth": 1.01, "first_optimization": 1, "displacement_threshold": 1e-15,
           "max_iterations": 1000000}
HEAD = """# Morphs by URL under load

Written by `tests/bench/by_url_load.py`. The daemon answers `GET /v1/morph.glb` of a morph that exists, dog and giraffe of
the samples; nginx serves the same bytes as a file. wrk, nginx, the daemon and the jobs share {cores} cores. Numbers are
medians of {repeat} alternating runs of {seconds} s. The *ratio* is requests per second of the daemon over those of nginx,
the smallest and largest of the runs in brackets. *Processor time* is what a server and wrk use together for one request, in
microseconds. Its ratio is about the ratio that the rates would have on a machine without other load. Goals are checked
against the rates. With *two jobs running*, two embeddings take every core that is left.

The daemon keeps assets of at most 4 MB in memory, and in a file without a name, from which the kernel sends them without a
copy (`server/http/regions.h`). It sends larger ones from their files. In the row of *64 visitors* each of 64 connections
sends a request, reads the answer and pauses for {pause} ms, so that neither server is saturated. The two jobs and the
visitors' own program share the cores; the column of nginx shows what that costs. The load average of the machine at the end
was {load:.0f}: with other load, rates and times say little, and processor time says more.

| what | daemon | nginx | ratio | processor time | goal | |
|---|---|---|---|---|---|---|
"""


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Daemon:
    def __init__(self, programs, folder):
        self.programs, self.data = programs, folder / "data"
        self.process = subprocess.Popen(
            [programs / "orbmorphd", "--listen", "127.0.0.1:0", "--data", self.data, "--workers", "2"],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.url = re.search(r"http://\S+", self.process.stdout.readline())[0]

    def send(self, path, body, kind="application/json", wait=60):
        request = urllib.request.Request(self.url + path, data=body, method="POST",
                                         headers={"Content-Type": kind, "Prefer": f"wait={wait}"})
        with urllib.request.urlopen(request) as answer:
            return json.load(answer)

    def mesh(self, file):
        return self.send(f"/v1/meshes?name={file.stem}", file.read_bytes(), "application/octet-stream")["id"]

    def get(self, path, headers=None):
        with urllib.request.urlopen(urllib.request.Request(self.url + path, headers=headers or {})) as answer:
            return answer.read()

    def signed(self, path):
        """The path with a signature of a new key (docs/assets-by-url.md)."""
        key, secret = subprocess.run([self.programs / "orbmorphd", "key", "add", "web", "--data", self.data], check=True,
                                     capture_output=True, text=True).stdout.strip().split(":")
        text = f"{path}&key={key}&expires={int(time.time()) + 86400}"
        return f"{text}&signature={hmac.new(secret.encode(), text.encode(), hashlib.sha256).hexdigest()}"

    def running(self):
        return json.loads(self.get("/readyz?verbose"))["running"]

    def stop(self):
        self.process.kill()
        self.process.wait()


def start_nginx(folder, files):
    """Serves the files of a dictionary by name; returns the process and the URL of its root."""
    site, port = folder / "www", free_port()
    site.mkdir()
    for name, content in files.items():
        (site / name).write_bytes(content)
    temps = " ".join(f"{kind}_temp_path {folder}/{kind};" for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi"))
    user = "user root; " if os.getuid() == 0 else ""
    (folder / "nginx.conf").write_text(
        f"{user}daemon off; worker_processes 2; pid {folder}/pid; error_log /dev/null;\n"
        f"events {{ worker_connections 4096; }}\n"
        f"http {{ access_log off; sendfile on; tcp_nopush on; keepalive_requests 100000000; {temps}\n"
        f"  default_type model/gltf-binary; gzip_static on; server {{ listen 127.0.0.1:{port}; root {site}; }} }}\n")
    process = subprocess.Popen(["nginx", "-c", folder / "nginx.conf", "-e", "/dev/null"])
    for _ in range(100):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return process, f"http://127.0.0.1:{port}"
        time.sleep(0.05)
    sys.exit("nginx does not start")


def spent(server):
    """Seconds of processor time of a server and its workers, and of all programs that have ended here: wrk."""
    children = pathlib.Path(f"/proc/{server}/task/{server}/children").read_text().split()
    ticks = 0
    for process in (server, *children):
        fields = pathlib.Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
        ticks += int(fields[11]) + int(fields[12])
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return ticks / os.sysconf("SC_CLK_TCK") + ended.ru_utime + ended.ru_stime


def wrk(url, server, seconds, headers=()):
    """Requests a second, 99th percentile in ms, microseconds of processor time a request."""
    before = spent(server)
    command = ["wrk", "-t2", f"-c{CONNECTIONS}", f"-d{seconds}s", "--latency", *(f"-H{h}" for h in headers), url]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    bad = re.search(r"Non-2xx or 3xx responses: \d+|Socket errors:.*", text)
    if bad:
        sys.exit(f"{url}: {bad[0]}")
    number, unit = re.search(r"99%\s+([\d.]+)(us|ms|s)\b", text).groups()
    rate, count = (float(re.search(pattern, text)[1]) for pattern in (r"Requests/sec:\s+([\d.]+)", r"(\d+) requests in"))
    return rate, float(number) * {"us": 1e-3, "ms": 1, "s": 1e3}[unit], 1e6 * (spent(server) - before) / count


def visits(url, headers):
    """99th percentile in ms of the time from a request to the last byte, one after the other on one connection."""
    parts, taken = urllib.parse.urlsplit(url), []
    connection = http.client.HTTPConnection(parts.netloc)
    for _ in range(VISITS):
        start = time.perf_counter()
        connection.request("GET", f"{parts.path}?{parts.query}" if parts.query else parts.path, headers=headers)
        connection.getresponse().read()
        taken.append(1e3 * (time.perf_counter() - start))
        time.sleep(0.001)
    connection.close()
    return statistics.quantiles(taken, n=100)[98]


async def visit_again(parts, until, taken):
    reader, writer = await asyncio.open_connection(parts.hostname, parts.port)
    ask = f"GET {parts.path}?{parts.query} HTTP/1.1\r\nHost: {parts.netloc}\r\n\r\n".encode()
    await asyncio.sleep(random.random() * CROWD_PAUSE_S)
    while time.perf_counter() < until:
        start = time.perf_counter()
        writer.write(ask)
        head = await reader.readuntil(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 200 "), head
        await reader.readexactly(int(re.search(rb"(?i)content-length: (\d+)", head)[1]))
        taken.append(1e3 * (time.perf_counter() - start))
        await asyncio.sleep(CROWD_PAUSE_S)
    writer.close()


def crowd(url):
    """99th percentile in ms of the same for many visitors at once, each with pauses."""
    async def all_of_them():
        until, taken = time.perf_counter() + CROWD_S, []
        await asyncio.gather(*(visit_again(urllib.parse.urlsplit(url), until, taken) for _ in range(CONNECTIONS)))
        return taken
    return statistics.quantiles(asyncio.run(all_of_them()), n=100)[98]


def compare(ours, theirs, servers, options, headers=()):
    """Medians of (rate, p99, processor time) of both, and the ratios of the rates."""
    runs = [tuple(wrk(url, server, options.seconds, headers) for url, server in zip((ours, theirs), servers))
            for _ in range(options.repeat)]
    ratios = [a[0] / b[0] for a, b in runs]
    median = [tuple(statistics.median(run[side][k] for run in runs) for k in range(3)) for side in (0, 1)]
    return median[0], median[1], ratios


class Table:
    def __init__(self):
        self.lines, self.missed = [], 0

    def add(self, what, ours, theirs, ratio, time, goal, met):
        self.missed += met is False
        verdict = "" if met is None else "met" if met else "MISSED"
        self.lines.append(f"| {what} | {ours} | {theirs} | {ratio} | {time} | {goal} | {verdict} |\n")
        print(self.lines[-1], end="", flush=True)

    def rates(self, what, found, goal=True):
        (rate, p99, cost), (other, other_p99, other_cost), ratios = found
        ratio = statistics.median(ratios)
        self.add(what, f"{rate:.0f}/s, p99 {p99:.1f} ms", f"{other:.0f}/s, p99 {other_p99:.1f} ms",
                 f"{ratio:.2f} ({min(ratios):.2f}–{max(ratios):.2f})",
                 f"{cost:.0f} and {other_cost:.0f}, {other_cost / cost:.2f}", f"ratio ≥ {RATIO_LEAST}" if goal else "",
                 ratio >= RATIO_LEAST if goal else None)


def measure(daemon, folder, options):
    dog, giraffe = daemon.mesh(SAMPLES / "dog.obj"), daemon.mesh(SAMPLES / "giraffe.off")
    landmarks = daemon.send("/v1/landmarks", (SAMPLES / "dog-giraffe.json").read_bytes())["id"]
    path = f"/v1/morph.glb?shapes={dog},{giraffe}&landmarks={landmarks}"
    glb, packed = daemon.get(path), daemon.get(path, {"Accept-Encoding": "gzip"})
    assert gzip.decompress(packed) == glb
    others = {name: (path + more, daemon.get(path + more)) for name, more in OTHERS.items()}
    nginx, site = start_nginx(folder, {"morph.glb": glb, "morph.glb.gz": packed,
                                       **{name: body for name, (_, body) in others.items()}})
    servers = (daemon.process.pid, nginx.pid)
    table, gzipped = Table(), ("Accept-Encoding: gzip",)
    kb = f"{len(glb) // 1000} KB"
    try:
        known, signed, file = daemon.url + path, daemon.url + daemon.signed(path), f"{site}/morph.glb"
        at = f"{CONNECTIONS} connections"
        table.rates(f"known URL, {kb}, {at}", compare(known, file, servers, options))
        table.rates(f"signed URL, {kb}, {at}", compare(signed, file, servers, options))
        table.rates(f"known URL, {len(packed) // 1000} KB of gzip, {at}", compare(known, file, servers, options, gzipped))
        for name, (target, body) in others.items():
            table.rates(f"known URL, {len(body) // 1000} KB, {at}",
                        compare(daemon.url + target, f"{site}/{name}", servers, options))
        for mesh in (dog, giraffe):
            daemon.send("/v1/embeddings", json.dumps({"mesh": mesh, "method": "kernel-sampling",
                                                      "options": ENDLESS}).encode(), wait=0)
        while daemon.running() < 2:
            time.sleep(0.05)
        for what, headers in ("", {}), (", gzip", {"Accept-Encoding": "gzip"}):
            ours, theirs = visits(known, headers), visits(file, headers)
            table.add(f"known URL{what}, two jobs running, one visitor after the other", f"p99 {ours:.2f} ms",
                      f"p99 {theirs:.2f} ms", "", "", f"p99 < {P99_MOST_MS:.0f} ms", ours < P99_MOST_MS)
        pairs = [(crowd(known), crowd(file)) for _ in range(options.repeat)]
        ours, theirs = (statistics.median(column) for column in zip(*pairs))
        table.add(f"known URL, two jobs running, {CONNECTIONS} visitors", f"p99 {ours:.2f} ms", f"p99 {theirs:.2f} ms", "",
                  "", f"p99 < {P99_MOST_MS:.0f} ms", ours < P99_MOST_MS)
        found = compare(known, file, servers, options)
        table.rates(f"known URL, two jobs running, {at}", found, goal=False)
        assert daemon.running() == 2, "the jobs ended"
    finally:
        nginx.terminate()
        nginx.wait()
    return table


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "build/bin")
    parser.add_argument("--seconds", type=int, default=5)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "docs/bench-by-url.md")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        daemon = Daemon(options.bin.resolve(), pathlib.Path(scratch))
        try:
            table = measure(daemon, pathlib.Path(scratch), options)
        finally:
            daemon.stop()
    options.out.write_text(HEAD.format(cores=os.cpu_count(), repeat=options.repeat, seconds=options.seconds,
                                       pause=round(1000 * CROWD_PAUSE_S), load=os.getloadavg()[0]) +
                           "".join(table.lines), encoding="utf-8")
    sys.exit(1 if table.missed else 0)


if __name__ == "__main__":
    main()
