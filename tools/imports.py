#!/usr/bin/env python3
"""Checks that imports between the top modules of a crate run one way.

The allowed directions are in ARCHITECTURE.md, section "Imports": for each crate a fenced block whose info string is
`imports FOLDER`, with one line per layer, from top to bottom. A module may import modules of lower layers. After a
semicolon a line may allow imports within its layer: `mesh stream query; stream -> query, mesh -> query`.

    tools/imports.py              checks all crates of the table; lists each import that is not allowed, and fails
    tools/imports.py --self-test  checks this script on a small tree with forbidden imports

Found are `crate::` and `super::` paths, with or without `use`. Names that `lib.rs` re-exports count for the module that
they come from. Comments, strings and `#[cfg(test)]` items are ignored.
"""

import re
import sys
import tempfile
from pathlib import Path

SECTION = re.compile(r"^## Imports$(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
BLOCK = re.compile(r"^```imports (\S+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
# Comments, strings and characters; a lifetime such as `'a` is none of them.
HIDDEN = re.compile(r"//[^\n]*|/\*.*?\*/|\bb?r(#*)\".*?\"\1|\"(?:\\.|[^\"\\])*\"|'(?:\\[^\n]+?|[^'\\\n])'", re.DOTALL)
TEST = re.compile(r"#\[cfg\((?:all\()?test\b[^\n]*?\]\s*(?:#\[[^\n]*\]\s*)*(?:pub(?:\([^)]*\))?\s+)?(?:mod\s+(\w+))?")
# A path, and the brace where its tree begins.
HEAD = re.compile(r"(?<![\w:])(?:crate|super)(?:\s*::\s*\w+)*\s*::\s*(?:\w+(?:\s+as\s+\w+)?|\*|\{)")
INLINE_MODULE = re.compile(r"\bmod\s+\w+\s*\{")
REEXPORT = re.compile(r"^pub use (\w+::[^;]*);", re.MULTILINE)


def main(arguments):
    if arguments == ["--self-test"]:
        return self_test()
    if arguments:
        sys.exit(__doc__)
    problems = check(Path(__file__).resolve().parent.parent)
    print("\n".join(problems) or "imports run one way")
    return 1 if problems else 0


def check(root):
    """All that is wrong in the tree at `root`, one line each."""
    section = SECTION.search((root / "ARCHITECTURE.md").read_text())
    blocks = BLOCK.findall(section[1]) if section else []
    if not blocks:
        return ['ARCHITECTURE.md: no block "imports FOLDER" in a section "Imports"']
    return [problem for folder, table in blocks for problem in check_crate(root, Path(folder), table)]


def check_crate(root, folder, table):
    rank, within, problems = read_table(folder, table)
    source = root / folder / "src"
    modules = {path.stem for path in source.iterdir() if path.suffix in ("", ".rs")}
    problems += [f"{folder}: ARCHITECTURE.md does not name `{name}`" for name in sorted(modules - set(rank))]
    problems += [f"{folder}: there is no module `{name}`" for name in sorted(set(rank) - modules)]
    for start, end, file, line in sorted(set(imports(source, modules))):
        known = start in rank and end in rank
        if known and start != end and rank[start] <= rank[end] and (start, end) not in within:
            problems.append(f"{start} -> {end} ({file.relative_to(root)}:{line})")
    return problems


def read_table(folder, table):
    """The height of each module above the lowest layer, what may be imported within layers, and what is wrong."""
    rank, within, problems = {}, set(), []
    for height, line in enumerate(reversed(table.strip().splitlines())):
        layer, _, allowed = line.partition(";")
        problems += [f"{folder}: `{name}` is in two layers" for name in layer.split() if name in rank]
        rank.update((name, height) for name in layer.split())
        within |= {tuple(name.strip() for name in pair.split("->")) for pair in allowed.split(",") if pair.strip()}
    for pair in sorted(within):
        if len(pair) != 2 or rank.get(pair[0], -1) != rank.get(pair[1], -2) or reaches(pair[1], pair[0], within):
            problems.append(f"{folder}: `{' -> '.join(pair)}` leaves its layer or closes a circle")
    return rank, within, problems


def reaches(start, end, edges, seen=frozenset()):
    return start == end or any(
        reaches(to, end, edges, seen | {start}) for of, to in edges if of == start and to not in seen
    )


def imports(source, modules):
    """Each import of a crate's top module as `(from, to, file, line)`."""
    tests, texts = set(), {}
    for file in source.rglob("*.rs"):
        texts[file] = hide_tests(HIDDEN.sub(blank, file.read_text()), children(file), tests)
    # The module that each name at the crate's root comes from.
    root = "".join(f"crate::{use} " for use in REEXPORT.findall(texts[source / "lib.rs"]))
    origin = {path[-1]: path[0] for path, _ in paths(root)} | {module: module for module in modules}
    for file, text in texts.items():
        if any(test in (file.with_suffix(""), *file.parents) for test in tests):
            continue
        own = tuple(name for name in file.relative_to(source).with_suffix("").parts if name != "lib")
        inline = [(found.start(), item_end(text, found.start())) for found in INLINE_MODULE.finditer(text)]
        for path, place in paths(text):
            depth = len(own) + sum(start < place < end for start, end in inline)
            ups = path.count("super") if text.startswith("super", place) else depth
            # Above the crate's own modules only the root is left.
            if ups >= depth:
                names = [name for name in path if name != "super"]
                to = origin.get(names[0], "lib") if names else "lib"
                yield (own[0] if own else "lib"), to, file, text.count("\n", 0, place) + 1


def paths(text):
    """All `crate::` and `super::` paths, without `crate`, each with the place where its tree begins."""
    after = 0
    while head := HEAD.search(text, after):
        after = item_end(text, head.end() - 1) if head[0].endswith("{") else head.end()
        yield from ((path, head.start()) for path in expand(text[head.start() : after]))


def expand(tree):
    """The paths of a tree such as `a::{self, b::{c, d as e}}`: `a`, `a::b::c`, `a::b::e`."""
    head, brace, rest = tree.partition("{")
    names = re.findall(r"[\w*]+", re.sub(r"\w+\s+as\b", "", head))
    prefix = tuple(name for name in names if name not in ("crate", "self"))
    if not brace:
        return [prefix] if names else []
    parts, depth = [""], 0
    for letter in rest[: rest.rindex("}")]:
        depth += {"{": 1, "}": -1}.get(letter, 0)
        parts = [*parts, ""] if letter == "," and depth == 0 else [*parts[:-1], parts[-1] + letter]
    return [prefix + path for part in parts for path in expand(part)]


def children(file):
    """The folder of a file's child modules."""
    return file.parent if file.stem == "lib" else file.with_suffix("")


def blank(found):
    """Blanks instead of what was found; lines stay where they are."""
    return re.sub(r"[^\n]", " ", found if isinstance(found, str) else found[0])


def hide_tests(text, folder, tests):
    """The text without items under `#[cfg(test)]`; modules in files of their own are added to `tests`."""
    while found := TEST.search(text):
        end = item_end(text, found.end())
        if found[1] and text[end - 1] == ";":
            tests.add(folder / found[1])
        text = text[: found.start()] + blank(text[found.start() : end]) + text[end:]
    return text


def item_end(text, start):
    """The place behind the item at `start`: behind its `;` or its last brace."""
    depth = 0
    for place in range(start, len(text)):
        depth += {"{": 1, "(": 1, "[": 1, "}": -1, ")": -1, "]": -1}.get(text[place], 0)
        if depth == 0 and text[place] in ";}":
            return place + 1
    return len(text)


def self_test():
    tree = {
        "ARCHITECTURE.md": """# House\n\n## Imports
```imports crates/a\nlib\ntop other; other -> top\nmiddle\nlow\n```\n\n## More\n""",
        "crates/a/src/lib.rs": "mod low;\nmod middle;\nmod other;\nmod top;\npub use top::{Top, part::Deep as Renamed};\n",
        "crates/a/src/top.rs": "use crate::{low::{A, B}, middle};\nuse super::other::C;\n",
        "crates/a/src/other.rs": "use crate::top;\nfn f<'a>(a: &'a str) -> char { '\"' }\nfn g() { crate::lib_only() }\n",
        "crates/a/src/middle.rs": """//! use crate::top;\n/* crate::top */
use crate::{
    low::{self, A as B},
    top::Top,
};
const TEXT: &str = "crate::top // \\" ";
#[cfg(test)]\nmod tests;\n#[cfg(test)]\nmod more {\n    use crate::top;\n}\n#[cfg(test)]\nuse crate::top;
mod inner {\n    use super::super::top;\n    use super::part;\n}\nfn f() { crate::other::g(super::low::h) }\n""",
        "crates/a/src/middle/tests.rs": "use crate::top;\n",
        "crates/a/src/middle/tests/deep.rs": "use crate::top;\n",
        "crates/a/src/middle/part.rs": "use super::{inner, super::other};\nuse super::top_of_middle;\n",
        "crates/a/src/low.rs": "use crate::{\n    Renamed,\n    low::part,\n};\n",
    }
    expected = [
        "low -> top (crates/a/src/low.rs:1)",
        "middle -> other (crates/a/src/middle/part.rs:1)",
        "middle -> other (crates/a/src/middle.rs:20)",
        "middle -> top (crates/a/src/middle.rs:3)",
        "middle -> top (crates/a/src/middle.rs:17)",
        "other -> lib (crates/a/src/other.rs:3)",
        "top -> other (crates/a/src/top.rs:2)",
    ]
    with tempfile.TemporaryDirectory() as folder:
        for name, text in tree.items():
            path = Path(folder, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        found = check(Path(folder))
        if found != expected:
            sys.exit("expected:\n" + "\n".join(expected) + "\nfound:\n" + "\n".join(found))
        table = Path(folder, "ARCHITECTURE.md")
        table.write_text(table.read_text().replace("-> top", "-> top, top -> other").replace("middle\n", "missing\n"))
        circles = [problem for problem in check(Path(folder)) if "circle" in problem or "missing" in problem]
        if len(circles) != 3:
            sys.exit("expected two circles and a missing module, but found:\n" + "\n".join(circles))
    print("the self-test passed")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
