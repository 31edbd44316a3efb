#!/usr/bin/env python3
"""Checks the documentation against the repository, without building anything.

    python3 tests/docs/check.py                              links, anchors, pages of the site, paths that the text names
    python3 tests/docs/check.py --paws target/release/paws   also commands, options and config keys
    python3 tests/docs/check.py --site target/site           also the links of the site that `mdbook build` wrote

A fault is one line: file, line, what is wrong. Exit code 1 where there is any.
"""

from __future__ import annotations

import argparse
import pathlib
import posixpath
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Pages that are no part of the site: people read them where they lie.
BESIDE = ["python/README.md", "assets/viewer/README.md", "fuzz/README.md", "tests/simulators/README.md"]
SUMMARY = "site/SUMMARY.md"
LINK = re.compile(r"\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^()\s]+)\)")
CODE = re.compile(r"`+[^`]*`+")
# Paths of the repository, as text names them in backticks.
NAMED = re.compile(r"`((?:src|tests|examples|docs|assets|templates|benches|fuzz|perceive|python|site)/[\w./-]*)`")
# A command in a line of code, and one in backticks.
IN_CODE = re.compile(r"(?:^\s*|[|;&]\s*|\bdo )paws ([a-z]+)([^|&;#]*)")
IN_PROSE = re.compile(r"`paws ([a-z]+)([^`]*)`")
KEY = re.compile(r"`(hands|localization|geometry|reasoning|inference|alignment|fitting|appearance|validation|comparison)\.(\w+)(?: = [^`]*)?`")


class Page:
    """One Markdown file: its lines, with fenced code apart."""

    def __init__(self, path, root=ROOT):
        self.name = path
        self.path = root / path
        self.prose, self.code = [], []
        fenced = False
        for number, line in enumerate(self.path.read_text(encoding="utf-8").splitlines(), 1):
            if line.lstrip().startswith("```"):
                fenced = not fenced
            else:
                (self.code if fenced else self.prose).append((number, line))

    def anchors(self):
        """Anchors of the headings, as GitHub and mdBook make them: a repeated one gets a number."""
        found = {}
        for _, line in self.prose:
            heading = re.match(r"#{1,6}\s+(.*)", line)
            if heading:
                text = re.sub(r"\]\([^)]*\)", "]", heading.group(1)).lower()
                slug = re.sub(r"[^\w\- ]", "", text).strip().replace(" ", "-")
                found[slug] = found.get(slug, -1) + 1
        return {slug if i == 0 else f"{slug}-{i}" for slug, count in found.items() for i in range(count + 1)}


def site_pages(root=ROOT):
    """Pages of the site, in the order of its table of contents."""
    return [target for _, line in Page(SUMMARY, root).prose for target in LINK.findall(line)]


def inside(path):
    """The path below the root, without `..`; `None` where it leads out."""
    name = posixpath.normpath(path)
    return None if name.startswith("..") else name


def link_faults(page, pages, root=ROOT):
    """Links that lead nowhere. A page of the site may only lead to what the site has: pages, and files of docs/ and examples/."""
    on_site = page.name in site_pages(root)
    for number, line in page.prose:
        for target in LINK.findall(CODE.sub(lambda m: "" if "](" in m.group() else m.group(), line)):
            if re.match(r"[a-z]+:", target):
                continue
            path, _, anchor = target.partition("#")
            name = inside(posixpath.join(posixpath.dirname(page.name), path)) if path else page.name
            if name is None or not (root / name).exists():
                yield page.name, number, f"the link {target} leads to no file"
                continue
            if on_site and not (root / "site" / name).is_file():
                yield page.name, number, f"the link {target} leads to what the site lacks: link a page, or name the path"
            if name.endswith(".md"):
                other = pages.get(name) or Page(name, root)
                if on_site and name not in site_pages(root):
                    yield page.name, number, f"the link {target} leads to a page that {SUMMARY} lacks"
                if anchor and anchor not in other.anchors():
                    yield page.name, number, f"the link {target}: {name} has no heading #{anchor}"


def path_faults(page, root=ROOT):
    """Paths of the repository that the text names and that are not there."""
    for number, line in page.prose:
        for path in NAMED.findall(line):
            if not (root / path).exists() and not (page.path.parent / path).exists():
                yield page.name, number, f"there is no {path}"


def summary_faults(root=ROOT):
    """Pages that the table of contents lacks, or names twice."""
    listed = site_pages(root)
    for name in sorted(f"docs/{p.name}" for p in (root / "docs").glob("*.md")):
        if name not in listed:
            yield SUMMARY, 1, f"lacks {name}"
    for name in sorted({n for n in listed if listed.count(n) > 1}):
        yield SUMMARY, 1, f"names {name} twice"


def helps(paws):
    """{command: its help} of the program."""
    def of(*args):
        return subprocess.run([paws, *args, "--help"], check=True, capture_output=True, text=True).stdout
    names = re.findall(r"^  ([a-z]+)  ", of().split("Commands:")[1].split("Options:")[0], re.M)
    return {name: of(name) for name in names if name != "help"}


def command_faults(page, known):
    """Commands and options of `paws` that the program does not have."""
    found = [(n, words) for n, line in page.code for words in IN_CODE.findall(line)]
    found += [(n, words) for n, line in page.prose for words in IN_PROSE.findall(line)]
    for number, (command, rest) in found:
        if command not in known:
            yield page.name, number, f"paws has no command {command}"
            continue
        for option in re.findall(r"(?<!\S)--[a-z][a-z-]*", rest):
            if not re.search(re.escape(option) + r"(?![a-z-])", known[command]):
                yield page.name, number, f"paws {command} has no option {option}"


def key_faults(page, keys):
    """Config keys that the text names and that `paws config` does not have."""
    for number, line in page.prose:
        for section, key in KEY.findall(line):
            if f"{section}.{key}" not in keys and key not in ("json", "jsonl", "rs"):
                yield page.name, number, f"paws config has no {section}.{key}"


def built_faults(site):
    """Links of the built pages that lead nowhere: what a heading's anchor is, mdBook says, not we."""
    html = {page: page.read_text(encoding="utf-8") for page in site.rglob("*.html")}
    for page, text in html.items():
        for target in re.findall(r'(?:href|src)="([^"]+)"', text):
            if re.match(r"[a-z]+:", target) or page.name in ("404.html", "print.html", "toc.html"):
                continue
            path, _, anchor = target.partition("#")
            other = pathlib.Path(posixpath.normpath(page.parent / path)) if path else page
            if not other.exists() or (anchor and f'id="{anchor}"' not in html.get(other, "")):
                yield str(page.relative_to(site)), 1, f"the link {target} leads nowhere"


def faults(root=ROOT, paws=None):
    """All faults: (file, line, what)."""
    names = list(dict.fromkeys(site_pages(root) + [name for name in BESIDE if (root / name).exists()]))
    pages = {name: Page(name, root) for name in names if (root / name).exists()}
    yield from ((SUMMARY, 1, f"names {name}, which is not there") for name in names if name not in pages)
    yield from summary_faults(root)
    for page in pages.values():
        yield from link_faults(page, pages, root)
        yield from path_faults(page, root)
    if paws:
        known = helps(paws)
        table = subprocess.run([paws, "config"], check=True, capture_output=True, text=True).stdout
        # Indented lines are meanings.
        keys = {line.split()[0] for line in table.splitlines()[2:] if line[:1].strip()}
        for page in pages.values():
            # What a changelog says of an older version holds for that version.
            if page.name != "CHANGELOG.md":
                yield from command_faults(page, known)
                yield from key_faults(page, keys)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--paws", help="the program, to hold commands, options and config keys against it")
    parser.add_argument("--site", type=pathlib.Path, help="the folder that `mdbook build` wrote, to check its links too")
    args = parser.parse_args()
    found = list(faults(paws=args.paws)) + (list(built_faults(args.site)) if args.site else [])
    for name, number, what in found:
        print(f"{name}:{number}: {what}")
    print(f"{len(site_pages())} pages, {len(found)} faults")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
