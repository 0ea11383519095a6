"""Rules over scores: what they mean on intervals, which diagnoses results get, and what is said where one is wrong."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.stats

from taskspec.base.diagnostics import Collector, Origin, Span, SpecError
from taskspec.exact.rules.evaluator import Truth
from taskspec.language import registry
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.parse import parse
from taskspec.learn.documents.rule_books import read_exam
from taskspec.learn.documents.score_rules import Comparison, ScoreEvaluator, check_rule
from taskspec.learn.documents.score_words import ABOUT_LEARNER, FIXED, FUNCTIONS, NUMBERS, QUANTIFIERS, SIDES, RuleNames
from taskspec.learn.documents.seed_scores import ONE, SeedScores
from taskspec.learn.statistics import estimate
from tests.shared.exams import TITLES, entry, exam
from tests.shared.for_each import for_each

SUITE = registry.tasks_root() / "derail"
TASKS = tuple(TITLES)
MASTERED = dict.fromkeys(TASKS, 1.0)


def expression(text: str) -> s.Expr:
    origin = Origin("rule", text)
    return parse(s.SourceText(text, lambda start, end: Span(origin, 1, start + 1, 1, end + 1)))


def judged(rule: str, results: dict[str, Any], names: RuleNames | None = None) -> Truth[Comparison]:
    names = names or RuleNames(TASKS)
    collector = Collector()
    check_rule(expression(rule), names, collector)
    assert not collector.diagnostics, collector.diagnostics
    return ScoreEvaluator(SeedScores({ONE: results}), names).truth(expression(rule))


def test_the_interval_of_a_mean_is_students_and_of_two_values_that_of_their_share() -> None:
    sample = np.random.default_rng(3).normal(0.7, 0.3, 15)
    theirs = scipy.stats.ttest_1samp(sample, 0).confidence_interval(0.95)
    assert estimate(sample, "mean", "a sample").interval == pytest.approx(tuple(theirs), abs=1e-3)
    share = scipy.stats.binomtest(12, 15).proportion_ci(0.95)
    two_values = [0.1] * 3 + [0.9] * 12
    wanted = (0.1 + 0.8 * share.low, 0.1 + 0.8 * share.high)
    assert estimate(two_values, "mean", "two values").interval == pytest.approx(wanted, abs=1e-3)


@pytest.mark.parametrize(("statistic", "true"), [("sd", 1.0), ("median", np.log(2))])
def test_intervals_of_skewed_scores_contain_the_truth_about_as_often_as_they_say(statistic: Any, true: float) -> None:
    rng = np.random.default_rng(0)
    inside = 0
    for i in range(400):
        low, high = estimate(rng.exponential(size=15), statistic, str(i)).interval
        inside += low <= true <= high
    assert inside / 400 > 0.85


def test_the_interval_of_a_difference_is_nearly_welchs() -> None:
    rng = np.random.default_rng(3)
    a = rng.uniform(0.1, 0.9, 15).tolist()
    b = rng.uniform(0.3, 0.9, 15).tolist()
    (seen,) = judged("score(Sort) > score(Parabola)", exam({"Sort": a, "Parabola": b})).evidence
    welch = scipy.stats.ttest_ind(a, b, equal_var=False).confidence_interval(0.95)
    assert (seen.low, seen.high) == pytest.approx(tuple(welch), abs=0.02)
    assert seen.value == pytest.approx(np.mean(a) - np.mean(b))


def test_what_is_compared_with_itself_is_equal_draw_by_draw() -> None:
    results = exam({"Sort": [0.0, 1.0, 0.3, 0.8]})
    assert judged("score(Sort) - score(Sort) == 0", results).holds is True


@for_each(
    ("rule", "holds"),
    [
        ("score(Sort) > 0.9", True),
        ("score(Sort) >= 1", True),
        ("score(Sort) < 1", False),
        ("score(Sort) == 1", True),
        ("score(Parabola) > 0.5", None),
        ("score(Parabola) < 2", True),
        ("score(Parabola) > 2", False),
        ("-1 < score(Parabola) < 2", True),
        ("not score(Parabola) > 0.5", None),
        ("score(Parabola) > 0.5 and score(Sort) < 0", False),
        ("score(Parabola) > 0.5 and score(Sort) > 0", None),
        ("score(Parabola) > 0.5 or score(Sort) > 0", True),
        ("score(ProcGoal) > 0.5", None),
        ("score(ProcGoal) > 0.5 or score(Sort) > 0", True),
        ("sd(Sort) == 0", True),
        ("sd(Parabola) > 0.3", True),
        ("highest(Parabola) > 0.9 and lowest(Parabola) < 0.1", True),
        ("constant(Branching) > 0.9", True),
        ("score(Sort, twin) < 0.2", True),
        ("abs(score(Sort, twin) - score(Sort)) > 0.8", True),
        ("max(score(Sort), score(Sort, twin)) == 1", True),
        ("all(score(t) > 0 for t in {Sort, Parabola})", True),
        ("all(score(t) > 0 for t in tasks)", None),
        ("any(score(t) > 0.9 for t in tasks)", True),
        ("any(score(t) > 0.9 for t in tasks if t != Sort)", None),
        ("any(score(t) > 0.9 for t in tasks if t in {Parabola})", False),
        ("most(score(t) > 0.5 for t in {Sort, Parabola, ProcGoal})", None),
        ("most(score(t) > 0 for t in {Sort, Parabola, ProcGoal})", True),
        ("count(score(t) > 0 for t in tasks) >= 2", True),
        ("count(score(t) > 0 for t in tasks) >= 3", None),
        ("count(score(t) > 0 for t in {Sort, Parabola}) > 2", False),
        ("mean(score(t) for t in {Sort, Parabola, Sort}) > 0.6", True),
        ("mean(score(t) for t in {Sort, Parabola, ProcGoal}) > 0.9", False),
        ("mean(abs(score(t) - 1) for t in {Sort, Parabola}) < 0.2", None),
        ("mean(score(t) for t in {ProcGoal}) > 0", None),
    ],
)
def test_rules_have_three_values(rule: str, holds: bool | None) -> None:
    half = [0.0, 1.0] * 8
    assert judged(rule, exam({"Sort": 1.0, "Parabola": half}, {"Sort": 0.1})).holds is holds


def test_one_seed_decides_nothing() -> None:
    assert judged("score(Sort) > 0", exam({"Sort": 1.0}, seeds=1)).holds is None


def test_results_that_failed_do_not_count() -> None:
    results = exam({"Sort": 1.0}) | {"scores": [entry("Sort", i, 1.0 if i < 9 else None) for i in range(15)]}
    (seen,) = judged("score(Sort) == 1", results).evidence
    assert seen.value == 1.0


def test_the_evidence_is_what_decides() -> None:
    found = judged("any(score(t) < 0.5 for t in tasks)", exam(MASTERED | {"Sort": 0.2, "ProcGoal": 0.1}))
    first, second = found.evidence
    assert (first.tasks, str(first)) == (("ProcGoal",), "score(ProcGoal) = 0.10")
    assert (second.tasks, str(second)) == (("Sort",), "score(Sort) = 0.20")


def test_the_documentation_lists_what_rules_may_say() -> None:
    page = (registry.tasks_root().parent / "docs" / "explain" / "diagnoses.md").read_text(encoding="utf-8")
    written = {word.written for word in FIXED.values()}
    for number in NUMBERS.values():
        written.add(number.word.written)
    for word, names in ABOUT_LEARNER.values():
        written |= {word.written, *names}
    for name in written:
        assert f"`{name}`" in page, name
    for name in (*QUANTIFIERS, *FUNCTIONS):
        assert f"`{name}(" in page, name
    for side in ("score(task, twin)", *SIDES):
        assert side in page


HEAD = "exam: 1\ndiagnoses:\n  d:\n    message: m\n    cause: c\n    try: t\n    source: {key: freire2020derail}\n"


def mistakes(text: str, folder: Path) -> list[tuple[str, str, str | None]]:
    """Code, place and hint of all that is wrong with an exam that lies beside our specs."""
    for path in SUITE.iterdir():
        if path.is_file() and path.name != "exam.yaml":
            (folder / path.name).write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    path = folder / "exam.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SpecError) as error:
        read_exam(path)
    return [(d.code, f"{d.span.line}:{d.span.column}", d.hint) for d in error.value.diagnostics if d.span is not None]


@pytest.mark.parametrize(
    ("when", "code", "column", "hint"),
    [
        ("score(ProcGol) > 0.9", "E302", 17, "did you mean 'ProcGoal'?"),
        ("scor(Sort) > 0.9", "E303", 11, "did you mean 'score'?"),
        ("score(Sort) > 0.9 and score(Sort, twins) > 0", "E302", 45, "did you mean 'twin'?"),
        ("score(Sort, twin, 3) > 0", "E304", 11, "behind them may stand printed, twin, negated, extended"),
        ("score(Sort)", "E306", 11, "for example `score(task) > 0.9`"),
        ("Sort > 0.9", "E306", 11, "for example `score(Sort)`"),
        ("score(Sort) >", "E301", 23, None),
        ("all(score(t) > 0 for t in taks)", "E302", 37, "did you mean 'tasks'?"),
        ("all(score(u) > 0 for t in tasks)", "E302", 21, None),
        ("any(score(Sort))", "E304", 11, "`any(score(t) > 0.9 for t in tasks)`"),
        ("score(Sort) > 0 if 1 else 2", "E306", 11, "for example `score(task) > 0.9`"),
        ("all(score(t) > 0 for t in tasks if score(t) > 0)", "E316", 46, None),
    ],
)  # fmt: skip
def test_a_bad_rule_is_told_at_its_place(when: str, code: str, column: int, hint: str | None, tmp_path: Path) -> None:
    (found,) = mistakes(f'{HEAD}    when: "{when}"\n', tmp_path)
    assert found[:2] == (code, f"8:{column + 1}")
    assert hint is None or found[2] == hint


@pytest.mark.parametrize(
    ("old", "new", "code", "place"),
    [
        ("freire2020derail", "freire2020derial", "E206", "7:19"),
        ("    cause: c\n", "    case: c\n", "E202", "5:5"),
        ("exam: 1", "exam: 2", "E207", "1:7"),
        ("exam: 1\n", "exam: 1\ntasks: [Sorted]\n", "E302", "2:9"),
        ("exam: 1\n", "exam: 1\ngroups: {easy: [Sort, Pong]}\n", "E302", "2:23"),
        ("exam: 1\n", "exam: 1\nsame: {Sorted: Sor}\n", "E302", "2:16"),
        ("    try: t\n", "    try: t\n    unless: [f]\n", "E302", "7:14"),
    ],
)
def test_a_bad_entry_is_told_at_its_place(old: str, new: str, code: str, place: str, tmp_path: Path) -> None:
    text = f"{HEAD}    when: score(Sort) > 0\n"
    assert old in text
    assert (code, place) in [each[:2] for each in mistakes(text.replace(old, new), tmp_path)]


def test_rules_are_read_again_when_they_or_the_specs_beside_them_have_changed(tmp_path: Path) -> None:
    for path in SUITE.iterdir():
        if path.is_file():
            (tmp_path / path.name).write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    path = tmp_path / "exam.yaml"
    path.write_text(f"{HEAD}    when: score(Sort) > 0.9\n", encoding="utf-8")
    first = read_exam(path)
    assert read_exam(path) is first
    path.write_text(f"{HEAD}    when: score(Sort) > 0.8\n", encoding="utf-8")
    assert read_exam(path).rules != first.rules
    (tmp_path / "sort.yaml").unlink()
    with pytest.raises(SpecError, match="Sort"):
        read_exam(path)
