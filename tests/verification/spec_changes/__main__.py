"""`python -m tests.verification.spec_changes`: every small change of some specs, and what notices it.

    python -m tests.verification.spec_changes tasks/derail
    python -m tests.verification.spec_changes tasks/derail/sort.yaml --list silent --jobs 2

Changes that no error, warning, claim or example notices show which mistakes could stay undetected.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from tests.verification.spec_changes.judge import CLASSES, judgements


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", type=Path, nargs="+", help="specs, or folders of them")
    parser.add_argument("--list", choices=CLASSES, default="silent", help="list the changes of this class")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    asked = parser.parse_args(arguments)
    print(f"{'':20} {'changes':>8}", *(f"{kind:>10}" for kind in CLASSES))
    listed = []
    for path in asked.paths:
        for file in sorted(path.glob("*.yaml")) if path.is_dir() else [path]:
            judged = list(judgements(file, asked.jobs))
            kinds = [judgement.kind for _, judgement in judged]
            print(f"{file.name:20} {len(kinds):8,}", *(f"{kinds.count(kind):10,}" for kind in CLASSES))
            for mutant, judgement in judged:
                if judgement.kind == asked.list:
                    place = f"{file}:{mutant.place.line}:{mutant.place.column}"
                    change = f"{mutant.before or '(nothing)'} -> {mutant.after}"
                    listed.append(f"{place}  {mutant.section}: {change}  {judgement.message or ''}".rstrip())
    for each in listed:
        print(each)


if __name__ == "__main__":
    main()
