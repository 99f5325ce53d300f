"""The source folder of Sphinx: a copy of ``docs``, pages from elsewhere, and what is generated.

Links in the repository lead from file to file, so that pages can be read there. In the copy they
lead to where the page is on the site; a link to a file that is no page becomes its text.
"""

import os
import re
from pathlib import Path

from dap3d_site import gallery
from dap3d_site.pages import generated

#: Pages that lie outside ``docs``, and their places on the site.
ELSEWHERE = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "models/README.md": "reference/shipped-models.md",
    "models/benchmarks/README.md": "reference/reference-problems.md",
    "models/contact/README.md": "reference/contact-models.md",
    "models/engineering/README.md": "reference/engineering-models.md",
}
#: The README is for who opens the repository; the site has pages of its own for what it says.
NOT_COPIED = ("README.md",)
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((?![a-z]+:|#)([^)#\s]+)(#[^)]*)?\)")
#: Copied beside the pages that show them, or offer them.
COPIED = (".png", ".svg", ".ipynb", ".gif")


def fill(source: Path, repository: Path) -> None:
    """Write all files of the source folder, which is a new one for each build.

    Raises:
        ValueError: the folder is the one of the pages themselves.
    """
    if (source / "conf.py").exists():
        raise ValueError(f"{source} is no folder to be filled; `make docs` builds the site")
    for name, content in everything(repository).items():
        path = source / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def everything(repository: Path) -> dict[str, bytes]:
    """Path and content of every file of the source folder."""
    found = {path: text.encode() for path, text in generated().items()}
    found |= {path: text.encode() for path, text in gallery.pages(repository)}
    places = places_of(repository)
    for file, place in places.items():
        if place.endswith(COPIED):
            found[place] = (repository / file).read_bytes()
        elif file not in NOT_COPIED:
            text = (repository / file).read_text(encoding="utf-8")
            found[place] = relinked(text, file, place, places, repository).encode()
    for model in gallery.models(repository):
        file = (model.folder / "README.md").relative_to(repository).as_posix()
        text = relinked(model.page, file, f"{model.document}.rst", places, repository)
        found[f"{gallery.INCLUDED}/{model.name}-page.md"] = text.partition("\n")[2].encode()
    return found


def places_of(repository: Path) -> dict[str, str]:
    """Files of the repository that are pages of the site or copied, and where they are there."""
    places = dict(ELSEWHERE)
    for file in sorted((repository / "docs").rglob("*")):
        within = file.relative_to(repository / "docs")
        if within.parts[0].startswith("_") or file.suffix not in (".md", *COPIED):
            continue
        place = within.with_name("index.md") if within.name == "README.md" else within
        places[f"docs/{within.as_posix()}"] = place.as_posix()
    return places


def relinked(text: str, file: str, place: str, places: dict[str, str], repository: Path) -> str:
    """The text of a page with links that lead to where their targets are on the site."""
    targets = places | {
        (model.folder / "README.md").relative_to(repository).as_posix(): f"{model.document}.rst"
        for model in gallery.models(repository)
    }

    def replaced(match: re.Match[str]) -> str:
        words, link, anchor = match[1], match[2], match[3] or ""
        target = os.path.normpath(os.path.join(os.path.dirname(file), link))
        if target not in targets:
            return words
        there = os.path.relpath(targets[target], os.path.dirname(place) or ".")
        return f"[{words}]({there}{anchor})"

    return LINK.sub(replaced, text)
