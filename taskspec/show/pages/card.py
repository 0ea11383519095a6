"""Cards of tasks for papers, data sets and hubs: JSON-LD in the terms of schema.org, and Markdown of the same content."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from taskspec.base.display import decimal, setting, small_fraction, visible
from taskspec.exact import Return
from taskspec.language.registry import shipped
from taskspec.language.task.task import Task
from taskspec.show.bibliography import Reference, beside
from taskspec.show.pages.facts import Facts
from taskspec.show.pages.render.markdown import escape
from taskspec.show.record import count, domain_words, space_words

LICENSE = "MIT"  # the licence of the tasks that come with the package; the authors of other specs give their own
TITLES = {"parameter": "parameter {}", "modifier": "modifier {}", "space": "{} space"}
LARGEST = 10_000  # the largest denominator of a return that is given as a fraction


def linked_data(task: Task, facts: Facts) -> dict[str, Any]:
    """Return the card of a task as JSON-LD; parameters, sizes, spaces, returns and claims are its `variableMeasured`."""
    spec = task.spec
    references = beside([task.source.document.origin.name])
    record: dict[str, Any] = {
        "@context": "https://schema.org",
        "@type": ["SoftwareSourceCode", "Dataset"],
        "identifier": [task.instance_id, f"sha256:{task.content_hash}"],
        "name": task.name,
        "headline": task.title or task.name,
        "description": " ".join((spec.summary or spec.description or task.title or task.name).split()),
        "version": str(task.source.version),
        "keywords": list(filter(None, ["reinforcement learning", spec.capability, *spec.keywords])),
        "programmingLanguage": "YAML",
        "runtimePlatform": "Gymnasium",
        "citation": [_citation(x.key, x.where, references.get(x.key)) for x in spec.sources],
        "variableMeasured": list(_properties(task, facts)),
    }
    if task.id in shipped():
        record["license"] = f"https://spdx.org/licenses/{LICENSE}"
    return record


def _citation(key: str, where: str | None, reference: Reference | None) -> dict[str, Any]:
    if reference is None:
        return {"@type": "CreativeWork", "identifier": key}
    authors = []
    for person in reference.plain("author").split(" and "):
        family, _, given = person.partition(", ")
        if person not in ("", "others"):
            authors.append({"@type": "Person", "name": f"{given} {family}".strip()})
    record: dict[str, Any] = {"@type": "ScholarlyArticle", "name": reference.plain("title"), "author": authors}
    for name, field in (("datePublished", "year"), ("url", "url")):
        if field in reference.fields:
            record[name] = reference.plain(field)
    if reference.venue:
        record["isPartOf"] = reference.venue
    if where:
        record["pagination"] = where
    return record


def _properties(task: Task, facts: Facts) -> Iterator[dict[str, Any]]:
    """Yield what is known of a task as values with names; `propertyID` is the kind of each."""
    for p in task.parameters:
        yield _property("parameter", p.name, p.value, "; ".join(filter(None, (domain_words(p), p.doc))))
    for modifier in task.modifiers:
        yield _property("modifier", modifier.name, str(modifier))
    yield _property("space", "observation", space_words(task.observation_layout))
    yield _property("space", "action", space_words(task.action_layout))
    sizes = {"states": count(task.state), "reachable states": facts.states, "actions": count(task.action)}
    for name, value in {**sizes, "horizon": task.horizon or "none", "discount": task.discount}.items():
        if value is not None:
            yield _property("size", name, value)
    for name, score in facts.scores.items():
        yield _return(name, score)
    for claim, verdict in zip(task.annotations.claims, facts.verdicts, strict=False):
        yield _property("claim", claim.text, verdict.holds, verdict.text)


def _property(kind: str, name: str, value: Any, description: str = "") -> dict[str, Any]:
    record = {"@type": "PropertyValue", "propertyID": kind, "name": name, "value": value}
    if description:
        record["description"] = description
    return record


def _return(name: str, score: Return) -> dict[str, Any]:
    value = float(score.value)
    if not score.exact:
        record = _property("return", name, value, f"mean of {score.episodes:,} episodes, 95 % interval")
        return record | {"minValue": value - score.half, "maxValue": value + score.half}
    fraction = small_fraction(score.value, LARGEST, 1e-12 * max(1.0, abs(value)))
    if fraction is None or fraction.denominator == 1:
        return _property("return", name, value, "exact")
    return _property("return", name, value, f"exact: {fraction}")


def markdown(card: dict[str, Any]) -> str:
    """Return a card as Markdown, with the front matter that hubs read."""
    kinds: dict[str, list[dict[str, Any]]] = {}
    for each in card["variableMeasured"]:
        kinds.setdefault(each["propertyID"], []).append(each)
    tags = ", ".join(map(_quoted, ("reinforcement-learning", *card["keywords"][1:])))
    lines = ["---", f"pretty_name: {_quoted(card['headline'])}", f"tags: [{tags}]"]
    if "license" in card:
        lines.append(f"license: {LICENSE.lower()}")
    lines += ["---", "", f"# {escape(card['name'])}: {escape(card['headline'])}", "", escape(card["description"]), ""]
    lines += ["| | |", "|---|---|", f"| id | `{card['identifier'][0]}` |", f"| version | {card['version']} |"]
    lines += [f"| keyword | {escape(word)} |" for word in card["keywords"][1:]]
    for kind in ("parameter", "modifier", "space", "size", "return"):
        for each in kinds.get(kind, ()):
            remark = ""
            if "description" in each:
                remark = f" ({escape(each['description'])})"
            title = TITLES.get(kind, "{}").format(each["name"])
            lines.append(f"| {escape(title)} | {_shown(each)}{remark} |")
    lines.append(f"| content | `{card['identifier'][1]}` |")
    if "claim" in kinds:
        lines += ["", "Claims:", ""]
        for each in kinds["claim"]:
            lines.append(f"- `{each['name']}`: {escape(each.get('description', 'not checked'))}")
    if card["citation"]:
        lines += ["", "Sources:", ""]
        for source in card["citation"]:
            lines.append(f"- {escape(_cited(source))}")
    return visible("\n".join(lines)) + "\n"


def _shown(each: dict[str, Any]) -> str:
    if "minValue" in each:
        return f"{decimal(each['value'])} in [{decimal(each['minValue'])}, {decimal(each['maxValue'])}]"
    if each["propertyID"] == "return":
        return decimal(each["value"], 10)
    value = setting(each["value"])
    if isinstance(each["value"], int | float):
        return value
    return escape(value)


def _cited(source: dict[str, Any]) -> str:
    if "name" not in source:
        return str(source["identifier"])
    people = [person["name"] for person in source["author"]]
    who = f"{', '.join(people)} ({source.get('datePublished', 'no year')})"
    return ". ".join(filter(None, (who, source["name"], source.get("isPartOf"), source.get("pagination"))))


def _quoted(text: str) -> str:
    return '"' + " ".join(text.split()).replace("\\", "\\\\").replace('"', '\\"') + '"'
