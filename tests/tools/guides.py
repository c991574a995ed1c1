#!/usr/bin/env python3
"""Checks that guides name files and folders that exist, and that links of documents lead somewhere.

    tests/tools/guides.py

A guide is a README.md or the comment at the head of a source file in core, api, server or client/cli. A name in a guide
is relative to its folder, to a folder above, or to a folder below. In a README.md a word in backquotes, such as `walk`,
names a folder or a file without its extension. The picture in CONTRIBUTING.md must have the folders of core, each once,
in an order that layers.py allows. A link in a Markdown file must lead to a file, and its anchor to a heading there. Exit
status 1: a name without a file, or a link that leads nowhere; each is printed. Standard library only; needs git.
"""
import os
import pathlib
import re
import subprocess
import sys

sys.dont_write_bytecode = True  # no __pycache__ beside the sources
import layers

NAME = re.compile(r"(?<![\w<./*-])[\w./-]*\w\.(?:inc\.h|c|h|cc|hh|md|py|sh|mjs|json)\b(?!>)")
FOLDER = re.compile(r"(?<![\w./<-])(?:[a-z_]+/)+(?![\w.*=<])")
WORD = re.compile(r"`([a-z][a-z0-9_]*)`")
PROGRAMS = {"orbmorph", "orbmorphd"}
LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"^```.*?^```|`[^`\n]*`", re.MULTILINE | re.DOTALL)


def tracked():
    files = subprocess.run(["git", "-C", layers.ROOT, "ls-files", "-co", "--exclude-standard"], capture_output=True,
                           text=True, check=True).stdout.splitlines()
    return [pathlib.PurePath(file) for file in files if (layers.ROOT / file).is_file()]


def guide(file):
    text = (layers.ROOT / file).read_text(encoding="utf-8")
    if file.name == "README.md":
        return text
    head = re.match(r"\s*/\*.*?\*/", text, re.DOTALL)
    return head[0] if head else ""


def is_there(name, folder, paths):
    """Whether the name, relative to a folder above or below, is one of the paths."""
    above = [folder, *folder.parents, pathlib.PurePath("core/include"), pathlib.PurePath("docs")]
    if any(base / name in paths for base in above):
        return True
    return any(folder in path.parents and path.as_posix().endswith("/" + name) for path in paths)


def missing(files):
    folders = {folder for file in files for folder in file.parents}
    paths = set(files) | folders | {file.with_suffix("") for file in files}
    for file in files:
        if file.parts[0] not in ("core", "api", "server") and file.parts[:2] != ("client", "cli"):
            continue
        if file.name != "README.md" and not layers.SOURCE.search(file.name):
            continue
        text = guide(file)
        system = set(re.findall(r"#include <([^>]+)>", (layers.ROOT / file).read_text(encoding="utf-8")))
        names = {name for name in NAME.findall(text) if name[0] not in "./"}  # .inc.h: an ending; /openapi.json: a route
        names = {name for name in names if not any(header.endswith(name) for header in system)}
        names |= {name.rstrip("/") for name in FOLDER.findall(text)}
        if file.name == "README.md":
            names |= {word for word in WORD.findall(text) if not word.startswith(("orb_", "api_"))} - PROGRAMS
        for name in sorted(names):
            if not is_there(name, file.parent, paths):
                yield f"{file}: there is no {name}"


def picture(files):
    """The folders of core in the picture of CONTRIBUTING.md, against those that exist and the order of layers.py."""
    text = (layers.ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    core = re.search(r"^core/ .*\n((?:  .*\n)+)", text, re.MULTILINE)
    shown = [f"core/{name}" for name in re.findall(r"^  ([\w/]+)/ ", core[1], re.MULTILINE)]
    existing = {"/".join(file.parts[:3 if file.parts[1] == "include" else 2]) for file in files
                if file.parts[0] == "core" and len(file.parts) > 2}
    for name in sorted(existing ^ set(shown)):
        yield f"CONTRIBUTING.md: {name} is {'not in the picture' if name in existing else 'in the picture only'}"
    order = [name for name in layers.ORDER if name in shown]
    if order != [name for name in shown if name in order]:
        yield f"CONTRIBUTING.md: the order of layers.py is {' '.join(order)}"


def anchors(text):
    """The anchors of headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken(files):
    """Links of Markdown files to files and headings that do not exist."""
    texts = {file: (layers.ROOT / file).read_text(encoding="utf-8") for file in files if file.suffix == ".md"}
    there = {folder for file in files for folder in file.parents} | set(files)
    for file, text in texts.items():
        for link in LINK.findall(CODE.sub("", text)):
            name, _, anchor = link.partition("#")
            if ":" in name:
                continue  # another site
            folder = "docs" if file.parts[:2] == ("tests", "bench") else file.parent  # heads of generated documents
            target = pathlib.PurePath(os.path.normpath(folder / pathlib.PurePath(name))) if name else file
            if target not in there:
                yield f"{file}: the link {link} leads to no file"
            elif anchor and anchor not in anchors(texts.get(target, "")):
                yield f"{file}: the link {link} leads to no heading"


def main():
    files = tracked()
    found = [*missing(files), *picture(files), *broken(files)]
    print("\n".join([*found, f"{len(found)} names and links that lead nowhere"]))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
