"""Make notebooks of tutorials.

    python tools/notebook.py [PAGE...]

Writes PAGE.ipynb beside each PAGE.md, by default that of the first tutorial: its blocks of Python
become cells, all else becomes text. The page is the source; a test compares the two and runs the
cells.
"""

import json
import re
import sys
from pathlib import Path

FIRST = Path(__file__).resolve().parents[1] / "docs/tutorials/slider-crank.md"
CODE = re.compile(r"^```python\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)
#: Links to other pages lead nowhere from a notebook that has been copied: their words remain.
LINK = re.compile(r"\[([^\]]*)\]\((?![a-z]+:)[^)]*\)")


def notebook(page: str) -> str:
    """The notebook (format 4.4) of a page of Markdown."""
    cells = []
    for k, text in enumerate(CODE.split(page)):  # text, code, text, ...
        words = text.strip() if k % 2 else LINK.sub(r"\1", text).strip()
        source = words.splitlines(keepends=True)
        code = {"execution_count": None, "outputs": []} if k % 2 else {}
        if source:
            kind = "code" if k % 2 else "markdown"
            cells.append({"cell_type": kind, "metadata": {}, "source": source, **code})
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    content = {"cells": cells, "metadata": metadata, "nbformat": 4, "nbformat_minor": 4}
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def main(pages: list[Path]) -> None:
    """Write the notebook of each page."""
    for page in pages:
        target = page.with_suffix(".ipynb")
        target.write_text(notebook(page.read_text(encoding="utf-8")), encoding="utf-8")
        print(f"{target} written")


if __name__ == "__main__":
    main([Path(page) for page in sys.argv[1:]] or [FIRST])
