"""Write docs/results.md from a study's report, and keep the hand-written parts.

python scripts/results_page.py runs/paper
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"
BEGIN, END = "<!-- what follows is made by scripts/results_page.py -->", "<!-- end of what is made -->"
COMMAND = re.compile(r"^ *drlsl study .*$", re.MULTILINE)
FOLDERS = re.compile(r"(?<=\s)/(?:[^\s/]+/)+")
"""The folders of an absolute path, which mean nothing on other machines."""

FIRST = "# Results\n\n"


def page(report: str, before: str) -> str:
    """Return the page: the hand-written parts of `before`, with the report between them."""
    above, _, rest = before.partition(BEGIN)
    below = rest.partition(END)[2]
    made = report.partition("\n")[2].replace("](figures/", "](results/").strip()
    made = COMMAND.sub(lambda line: FOLDERS.sub("", line[0]), made)
    return f"{above or FIRST}{BEGIN}\n\n{made}\n\n{END}{below or chr(10)}"


def main(study: Path) -> None:
    """Write the page and copy its figures."""
    report = study / "report"
    target = DOCS / "results.md"
    before = target.read_text(encoding="utf-8") if target.exists() else ""
    target.write_text(page((report / "report.md").read_text(encoding="utf-8"), before), encoding="utf-8")
    shutil.copytree(report / "figures", DOCS / "results", dirs_exist_ok=True)
    print(f"wrote {target}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python scripts/results_page.py STUDY_FOLDER")
    main(Path(sys.argv[1]))
