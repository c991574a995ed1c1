#!/usr/bin/env python3
"""Checks the layers: no circle of files, and nothing that includes or calls upward.

    tests/tools/layers.py BUILD [--list]

A unit is a source file together with the header of its name. An arrow runs from unit A to unit B where A includes B's
header, or an object file of A uses a symbol that B defines (nm). In TypeScript and JavaScript an arrow is an import.
--list prints the arrows between folders. Exit status 1: a circle or an upward arrow; each is printed with its cause.
It also counts the entries of folders in MOST_ENTRIES, and finds names of types in headers that name a second type.
Standard library only; needs nm and git.
"""
import collections
import os
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Each folder may use those before it, and itself. A file that lies beside folders has its own place, without the
# extension. CONTRIBUTING.md and server/README.md say what a folder holds.
ORDER = [
    "core/include/orbmorph", "core/base", "core/numeric", "core/mesh", "core/format", "core/embed/common",
    "core/embed/newton/vector", "core/embed/newton", "core/embed/kernel_sampling", "core/embed", "core/sphere",
    "core/spectral", "core/elastic", "core/align/sheet", "core/align/rotate", "core/align/pin", "core/align/rbf", "core/align/map/engine",
    "core/align/map/starts", "core/align/map/twist", "core/align/map", "core/align/map/rims",
    "core/align/find", "core/align",
    "core/remesh/common", "core/remesh/overlay", "core/remesh/placed", "core/remesh/adaptive", "core/remesh",
    "core/transfer", "core/carry", "core/profile", "core/merge", "api",
    "server/log", "server/trim", "server/hash", "server/faults", "server/wake", "server/budget", "server/temporary", "server/tasks", "server/metrics", "server/pages", "server/studio",
    "server/trace", "server/net", "server/config_values", "server/config", "server/audit", "server/control", "server/systemd", "server/store", "server/isolate", "server/intake", "server/convert", "server/deliver", "server/cache", "server/queue", "server/worker",
    "server/evict", "server/scrub", "server/maintain", "server/folder_lock", "server/backup", "server/migrate", "server/admin", "server/http", "server/housekeeping", "server/parts", "server/main",
    "client/cli", "client/js/src", "client/web/src/words", "client/web/src/mesh", "client/web/src/view", "client/web/src/theme",
    "client/web/src/focus", "client/web/src/take", "client/web/src/welcome", "client/web/src/state", "client/web/src/player",
    "client/web/src/actions", "client/web/src/url", "client/web/src/ui",
    "client/web/src/main"]
# These are defined in place of a library's, and callers mean the library's: server/http/regions.c for libmicrohttpd, and
# operator new and delete of server/isolate/meter.cc for Draco.
IN_PLACE = {"sendmsg", "_Znwm", "_ZdlPv", "_ZdlPvm"}
MOST_ENTRIES = {"core/align": 10}  # the most files and folders directly in a folder, so that a reader sees its parts at once
SOURCE = re.compile(r"\.(inc\.h|c|h|cc|hh)$")
SCRIPT = re.compile(r"\.(d\.ts|tsx|ts|mjs|js)$")


def tracked(*places):
    listed = subprocess.run(["git", "-C", ROOT, "ls-files", "-co", "--exclude-standard", *places], capture_output=True,
                            text=True, check=True).stdout.splitlines()
    return [file for file in listed if (ROOT / file).is_file()]


def unit(file):
    return SCRIPT.sub("", SOURCE.sub("", file))


def add_includes(files, arrows):
    known = set(files)
    for file in files:
        for name in re.findall(r'#include "([^"]+)"', (ROOT / file).read_text(encoding="utf-8")):
            folder = os.path.dirname(file)
            for base in ("core/" + name, "core/include/" + name, "server/" + name, name, folder + "/" + name):
                base = os.path.normpath(base)
                if base in known:
                    if unit(base) != unit(file):
                        arrows[unit(file)][unit(base)].add(f"#include {name}")
                    break


def add_calls(build, arrows):
    objects = {}
    for item in pathlib.Path(build).rglob("*.o"):
        found = re.search(r"/(core|api|server|client)/CMakeFiles/[^/]+\.dir/(.*)\.o$", str(item))
        file = f"{found[1]}/{found[2]}" if found else ""
        if found and (ROOT / file).is_file():
            objects[str(item)] = unit(file)
    # One nm for all: it loads the linker's plugins each time it starts, which takes longer than reading an object.
    names = subprocess.run(["nm", "-A", "-g", *objects], capture_output=True, text=True, check=True).stdout if objects else ""
    defined, used = {}, collections.defaultdict(set)
    for item, kind, name in re.findall(r"^(.*):(?:[0-9a-f]+| +) (\w) (\S+)$", names, re.MULTILINE):
        if name in IN_PLACE:
            continue
        if kind in "TDBRVWC":
            defined.setdefault(name, objects[item])
        elif kind == "U":
            used[objects[item]].add(name)
    for one, names in used.items():
        for name in names:
            if defined.get(name, one) != one:
                arrows[one][defined[name]].add(name)


def add_imports(files, arrows):
    known = {unit(file): file for file in files}
    for file in files:
        for name in re.findall(r"""(?:from|import)\s*\(?\s*['"](\.[^'"]+)['"]""", (ROOT / file).read_text(encoding="utf-8")):
            target = unit(os.path.normpath(os.path.join(os.path.dirname(file), name)))
            if target in known and target != unit(file):
                arrows[unit(file)][target].add(f"import {name}")


def circles(arrows):
    """Strongly connected components of more than one unit (Tarjan 1972, without recursion)."""
    index, low, stack, on, found = {}, {}, [], set(), []
    for root in sorted(arrows):
        if root in index:
            continue
        work = [(root, iter(sorted(arrows[root])))]
        index[root] = low[root] = len(index)
        stack.append(root)
        on.add(root)
        while work:
            at, rest = work[-1]
            for to in rest:
                if to not in index:
                    index[to] = low[to] = len(index)
                    stack.append(to)
                    on.add(to)
                    work.append((to, iter(sorted(arrows.get(to, ())))))
                    break
                if to in on:
                    low[at] = min(low[at], index[to])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[at])
                if low[at] == index[at]:
                    part = []
                    while not part or part[-1] != at:
                        part.append(stack.pop())
                        on.discard(part[-1])
                    if len(part) > 1:
                        found.append(sorted(part))
    return found


def named_twice(files):
    """Types that a header defines and another file of core, api, server or client defines as well, with these files."""
    places = collections.defaultdict(set)
    for file in files:
        text = (ROOT / file).read_text(encoding="utf-8")
        for name in re.findall(r"^typedef (?:struct|enum|union)\b[^;{]*\{.*?^\} ?(\w+);", text, re.MULTILINE | re.DOTALL):
            places[file.split("/")[0], name].add(file)
        for name in re.findall(r"^(?:typedef )?(?:struct|enum|union) (\w+) \{", text, re.MULTILINE):
            places[file.split("/")[0], name].add(file)
    return {name: sorted(found) for (_, name), found in sorted(places.items())
            if len(found) > 1 and any(file.endswith((".h", ".hh")) for file in found)}


def level(name):
    """The place in ORDER of the unit or of the nearest folder around it; None: it has no place."""
    while name and name not in ORDER:
        name = os.path.dirname(name)
    return ORDER.index(name) if name else None


def main():
    build, listing = sys.argv[1], "--list" in sys.argv
    sources = [file for file in tracked("core", "api", "server", "client/cli") if SOURCE.search(file)]
    scripts = [file for file in tracked("client/web/src", "client/js/src") if SCRIPT.search(file)]
    arrows = collections.defaultdict(lambda: collections.defaultdict(set))
    add_includes(sources, arrows)
    add_calls(build, arrows)
    if not any(name in cause for ends in arrows.values() for cause in ends.values() for name in ("orb_align", "api_json_parse")):
        print(f"{build} holds no object files; build first")
        return 1
    add_imports(scripts, arrows)
    faults = 0
    for one in sorted({*arrows, *(other for ends in arrows.values() for other in ends)}):
        if level(one) is None:
            faults += 1
            print(f"no place in ORDER: {one}")
    for part in circles(arrows):
        faults += 1
        print("circle:", " ".join(part))
        for one in part:
            for other in sorted(set(arrows[one]) & set(part)):
                print(f"    {one} -> {other}: {', '.join(sorted(arrows[one][other])[:4])}")
    for one in sorted(arrows):
        for other in sorted(arrows[one]):
            if one.startswith("client/") and not other.startswith("client/"):
                faults += 1
                print(f"a client knows only HTTP: {one} -> {other}: {', '.join(sorted(arrows[one][other])[:4])}")
            elif None not in (level(one), level(other)) and level(other) > level(one):
                faults += 1
                print(f"upward: {one} -> {other}: {', '.join(sorted(arrows[one][other])[:4])}")
    for folder, most in MOST_ENTRIES.items():
        entries = {file[len(folder) + 1:].split("/")[0] for file in tracked(folder)}
        if len(entries) > most:
            faults += 1
            print(f"{folder} has {len(entries)} entries, at most {most}: {' '.join(sorted(entries))}")
    for name, files in named_twice(sources).items():
        faults += 1
        print(f"{name} names two types: {' '.join(files)}")
    if listing:
        folders = collections.defaultdict(set)
        for one in arrows:
            for other in arrows[one]:
                if os.path.dirname(one) != os.path.dirname(other):
                    folders[os.path.dirname(one)].add(os.path.dirname(other))
        for one in sorted(folders):
            print(f"{one} -> {' '.join(sorted(folders[one]))}")
    print(f"{sum(len(ends) for ends in arrows.values())} arrows between {len(arrows)} units, {faults} at fault")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
