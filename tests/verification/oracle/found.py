"""Specs that once were wrong, kept as files: each says in its first line how it is put through the stages again."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.verification.oracle.compare.cases import Case, text_of
from tests.verification.oracle.compare.stages import STAGES, Finding, put_through
from tests.verification.oracle.minimise import minimised
from tests.verification.oracle.reference.merging import read

FOLDER = Path(__file__).parent / "found"
HEAD = "# oracle: "


@dataclass(frozen=True)
class Found:
    """A kept spec."""

    path: Path
    note: dict[str, Any]
    case: Case

    def findings(self) -> list[Finding]:
        """What is wrong with it now, in the stages that it is kept for."""
        return put_through(self.case, {name: STAGES[name] for name in self.note["stages"]}, None).findings


def kept() -> list[Found]:
    return [load(path) for path in sorted(FOLDER.glob("*.yaml"))]


def load(path: Path) -> Found:
    note = json.loads(path.read_text("utf-8").splitlines()[0].removeprefix(HEAD))
    case = Case(read(path), note.get("variant"), note.get("seed", 0), note.get("given", {}))
    return Found(path, note, case)


def smaller(case: Case, finding: Finding) -> Case:
    """The case with the smallest spec found that still has the fault."""
    stages = {name: STAGES[name] for name in dict.fromkeys(("load", finding.stage))}

    def still(spec: dict[str, Any]) -> bool:
        findings = put_through(Case(spec, case.variant, case.seed, case.given), stages, None).findings
        return any(f.signature == finding.signature for f in findings)

    return Case(minimised(case.spec, still), case.variant, case.seed, case.given)


def save(case: Case, finding: Finding, folder: Path = FOLDER) -> Path:
    note = {"stages": ["load", finding.stage] if finding.stage != "load" else ["load"], "seed": case.seed}
    note |= {k: v for k, v in (("variant", case.variant), ("given", case.given)) if v}
    note["was"] = finding.signature
    text = text_of(case.spec)
    name = finding.signature.replace(": ", "-").replace(" ", "-") + "-" + hashlib.sha256(text.encode()).hexdigest()[:6]
    path = folder / f"{name}.yaml"
    folder.mkdir(exist_ok=True)
    path.write_text(f"{HEAD}{json.dumps(note)}\n{text}", "utf-8")
    return path
