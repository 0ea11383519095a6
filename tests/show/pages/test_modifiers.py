"""Modifiers on pages: every entry of the table, on every DERAIL task that it applies to."""

from taskspec.show.pages.page import page
from taskspec.show.pages.prose import CodeSpan
from tests.language.modifiers.test_modifiers import GIVEN, found, small
from tests.shared.for_each import for_each


@for_each(("task_id", "name"), GIVEN)
def test_the_page_prints_the_modifier(task_id: str, name: str) -> None:
    task = found(task_id, name)
    printed = page(task)
    section = printed.section("modifiers")
    assert section is not None and len(section.lines) == 2
    assert section.lines[0].content[0] == CodeSpan(str(task.modifiers[0]))
    assert f"modifiers=[{str(task.modifiers[0])!r}]" in printed.make
    before = page(small(task_id))
    assert before.section("modifiers") is None
    assert printed.section("dynamics") == before.section("dynamics")  # the rest is the task as written
