#!/usr/bin/env python3
"""Measures the wall time and the CPU time of a job on a busy machine.

    tests/bench/busy.py [--bin build/bin] [--base BIN] [--loops 8] [--threads 2] [--repeat 5] [--job JOB]... [FILE...]

Runs each job with --base and --bin alternately, at rest and beside --loops busy loops. A loop gets what the scheduler
gives a thread that always wants to run, so the share of a job of T threads is T times what the loops get on average,
measured while it runs. At best the job takes CPU / share of wall time; `stretch` is its wall time over that.
At rest the share is T cores. Jobs are `embed`, one shape ten times, and `merge`, two shapes (both unless --job names
one). Standard library only; Linux.
"""
import argparse
import os
import pathlib
import statistics
import subprocess
import time

SAMPLES = pathlib.Path(__file__).resolve().parents[1] / "samples"
JOBS = {"embed": [SAMPLES / "giraffe.off"], "merge": [SAMPLES / "dog.obj", SAMPLES / "giraffe.off"]}


def cpu_of(processes):
    """CPU seconds that they have used so far."""
    ticks = 0
    for process in processes:
        fields = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def run(command, loops, threads):
    """Wall and CPU seconds, and the cores that the job had a right to."""
    before, loops_before, start = os.times(), cpu_of(loops), time.monotonic()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    wall, loops_after, after = time.monotonic() - start, cpu_of(loops), os.times()
    share = threads * (loops_after - loops_before) / len(loops) / wall if loops else min(threads, os.cpu_count())
    return wall, after.children_user + after.children_system - before.children_user - before.children_system, share


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--base", help="the programs of another version")
    parser.add_argument("--loops", type=int, default=8)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--job", action="append", choices=sorted(JOBS))
    parser.add_argument("files", nargs="*")
    options = parser.parse_args()
    programs = {"now": options.bin} | ({"base": options.base} if options.base else {})
    print(f"{options.threads} threads, {os.cpu_count()} cores, load average {os.getloadavg()[0]:.1f}, "
          f"medians of {options.repeat}\n\n| job | loops | program | CPU s | wall s | cores used | share | stretch |\n"
          "|---|---|---|---|---|---|---|---|")
    for job in options.job or sorted(JOBS):
        for loops in (0, options.loops):
            spinning = [subprocess.Popen(["sh", "-c", "while :; do :; done"]) for _ in range(loops)]
            found = {name: [] for name in programs}
            try:
                for _ in range(options.repeat):
                    for name, folder in programs.items():
                        command = [f"{folder}/orbmorph-bench", job, "--threads", str(options.threads),
                                   *(["--repeat", "10"] if job == "embed" else []), *(options.files or JOBS[job])]
                        found[name].append(run(command, spinning, options.threads))
            finally:
                for process in spinning:
                    process.kill()
                    process.wait()
            for name, runs in found.items():
                wall, cpu, share = (statistics.median(run[k] for run in runs) for k in range(3))
                stretch = statistics.median(run[0] * run[2] / run[1] for run in runs)
                print(f"| {job} | {loops} | {name} | {cpu:.2f} | {wall:.2f} | {cpu / wall:.2f} | {share:.2f} | "
                      f"{stretch:.2f} |", flush=True)


if __name__ == "__main__":
    main()
