#!/usr/bin/env python3
"""Checks that every list of formats or methods written by hand is complete.

    tests/tools/lists.py

The words come from core (SOURCES). Two checks find files that lack a word. First, where more than three quarters of the
words follow each other in a tracked file, all of them must. Second, the files in PLACES must have each word, in the
notation given there. Exit status 1: a word is missing; each is printed. Standard library only; needs git.
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
SOURCES = {
    "format": ("core/include/orbmorph/formats.h", r'FORMAT\(\w+, \d+, \w+, "([\w-]+)"'),
    "alignment method": ("core/include/orbmorph/alignment.h", r"\bORB_ALIGN_(\w+)"),
    "remesh method": ("core/include/orbmorph/remesh_methods.h", r'METHOD\(\w+, \w+, "([\w-]+)"'),
}
# Measurements and history name the formats and methods of their time.
LEFT_OUT = re.compile(r"(^|/)(RESULTS\.md|CHANGELOG\.md)$|^docs/bench|\.(png|jpg|glb|gz|xz|zst|stl|obj|off|ply)$|package-lock|tools/lists\.py$")
SEPARATOR = r"[^\w]{1,12}(?:(?:or|and)[^\w]{1,6})?"  # between two words of a list: punctuation, quotes, a line break

# What a file writes for each word; ? is the word.
PLACES = {
    "format": {
        "api/openapi.json": '"?"', "api/mesh_codec.c": "?", "client/cli/options.c": "?", "deploy/man/orbmorph.1": " ? ",
        "client/js/src/api.d.ts": "'?'", "client/js/example/index.html": ".?", "client/web/vite.config.ts": "?",
        "client/web/src/ui/files.tsx": ".?", "tests/bench/report.py": '".?"', "tests/fuzz/CMakeLists.txt": "?",
        "tests/fuzz/run.sh": "?", "tests/scenario/meshes.test.mjs": "'?', "},
    "alignment method": {
        "api/supermesh_request.c": '"?"', "api/openapi.json": '"?"', "client/cli/options.c": "?",
        "client/js/src/api.d.ts": "'?'", "client/web/src/state.ts": "'?'", "client/web/src/url.ts": "'?'",
        "client/web/src/ui/shapes.tsx": '"?"', "tests/bench/bench.c": '"?"', "deploy/man/orbmorph.1": "?",
        "deploy/man/orbmorph-bench.1": "?"},
    "remesh method": {
        "api/openapi.json": '"?"', "client/cli/options.c": "?", "client/js/src/api.d.ts": "'?'",
        "client/web/src/state.ts": "'?'", "client/web/src/url.ts": "'?'", "client/web/src/ui/shapes.tsx": '"?"',
        "deploy/man/orbmorph.1": "?", "deploy/man/orbmorph-bench.1": "?"},
}


def words(kind):
    source, pattern = SOURCES[kind]
    return list(dict.fromkeys(word.lower().replace("_", "-") for word in re.findall(pattern, read(source))))


def read(file):
    return (ROOT / file).read_text(encoding="utf-8").replace("\\-", "-")  # a man page writes \\-


def incomplete(files, kind, listed):
    """Lists that have more than three quarters of the words, but not all. In prose, "glTF" includes GLB."""
    one = r"(?<![\w-])(?:" + "|".join(listed) + r")(?![\w-])"
    runs = re.compile(f"{one}(?:{SEPARATOR}{one})+", re.IGNORECASE)
    for file in files:
        try:
            text = read(file)
        except UnicodeDecodeError:
            continue
        for run in runs.finditer(text):
            has = {word.lower() for word in re.findall(one, run[0], re.IGNORECASE)}
            if "glTF" in run[0]:
                has.add("glb")
            if 4 * len(has) > 3 * len(listed) and len(has) < len(listed):
                line = text.count("\n", 0, run.start()) + 1
                yield f"{file}:{line}: the list of {kind}s lacks {', '.join(sorted(set(listed) - has))}"


def unnamed(kind, listed):
    for file, notation in PLACES[kind].items():
        for word in listed:
            written = re.escape(notation).replace(r"\?", re.escape(word))
            border = r"(?<![\w-])" if notation[0] == "?" else "", r"(?![\w-])" if notation[-1] == "?" else ""
            if not re.search(border[0] + written + border[1], read(file)):
                yield f"{file}: the {kind} {word} is missing, as {notation.replace('?', word)}"


def main():
    files = subprocess.run(["git", "-C", ROOT, "ls-files", "-co", "--exclude-standard"], capture_output=True, text=True,
                           check=True).stdout.splitlines()
    files = [file for file in files if (ROOT / file).is_file() and not LEFT_OUT.search(file)]
    found = []
    for kind in PLACES:
        listed = words(kind)
        if len(listed) < 4:
            found.append(f"only {len(listed)} {kind}s found in core")
        found += [*incomplete(files, kind, listed), *unnamed(kind, listed)]
    print("\n".join([*found, f"{len(found)} words missing"]))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
