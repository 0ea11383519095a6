"""The shapes of experiments on pages, beside the JSON Schema that editors read."""

from pathlib import Path

import yaml
from jsonschema import Draft202012Validator

from taskspec.learn.documents.document_models import Experiment, document_schema
from tests.language.task.test_json_schema import PAGES, SNIPPET
from tests.shared.for_each import for_each


@for_each("page", PAGES)
def test_experiments_on_the_pages_are_accepted(page: Path) -> None:
    validator = Draft202012Validator(document_schema(Experiment))
    for comment, body in SNIPPET.findall(page.read_text(encoding="utf-8")):
        if "error:" in comment or "skip:" in comment or page.stem == "errors":
            continue
        data = yaml.safe_load(body)
        if "experiment" in data:
            validator.validate(data)
