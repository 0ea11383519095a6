"""Vectors element by element: every name, call and choice that has elements takes the index, and nothing else does."""

from functools import cache

from taskspec.language.expressions.parse import parse
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.show.pages.equations import Writing
from taskspec.show.printers.expressions import ExpressionWriter, mathematics
from taskspec.show.printers.names import Notation, nowhere, of_task
from taskspec.show.printers.rewrites import rank
from taskspec.show.printers.text import plain
from tests.shared.for_each import for_each

SPEC = """
taskspec: 1
name: Elements
parameters: {n: {type: int, default: 3, low: 2, high: 5}}
constants:
  w: "[k + 1 for k in range(n)]"
  W: "[[k + 2 * l for k in range(n)] for l in range(n)]"
  c: 2
state:
  x: {type: int, shape: [n], low: 0, high: 4}
  y: {type: int, shape: [n], low: 0, high: 4}
  B: {type: bool, shape: [n, n]}
  s: {type: int, low: 0, high: 4}
action:
  a: {type: int, low: 0, high: n - 1}
  move: {type: choice, values: {up: [0, 1, 0], down: [1, 0, 0]}}
definitions:
  gap: x - w
  near(v): abs(v - w) <= 1
  total: sum(gap)
noise:
  hit: Bernoulli(1/2, shape=n)
  one: Bernoulli(1/2)
  order: Permutation(n)
horizon: 3
initial: {x: "[0 for k in range(n)]", y: "[1 for k in range(n)]", B: "[[k > l for k in range(n)] for l in range(n)]", s: 2}
dynamics: {x': "clip(x + move - hit, 0, 4)"}
reward: total + gap[0] + near(x)[0] + c + one + W[0, 0] + order[0]
"""


@cache
def writing() -> Writing:
    return Writing(build(read_text(SPEC, "elements.yaml")), {})


def written(source: str) -> str:
    return plain(mathematics(parse(nowhere(source)), writing().notation))


@for_each(
    ("source", "expected"),
    [
        ("sum(x' * w)", "∑_(i) x′ᵢwᵢ"),
        ("sum(c * x * one * total)", "∑_(i) cxᵢ ⋅ one ⋅ total"),
        ("sum(gap ** 2) / n", "(∑_(i) gapᵢ²)/n"),
        ("sum(x * hit)", "∑_(i) xᵢ ⋅ hitᵢ"),
        ("sum(x + move)", "∑_(i) (xᵢ + moveᵢ)"),
        ("sum(near(x) * y)", "∑_(i) (near(x))ᵢ ⋅ yᵢ"),
        ("count(x' != w)", "#{i: x′ᵢ ≠ wᵢ}"),
        ("count(hit)", "#{i: hitᵢ}"),
        ("count(x > 1 and y > 1)", "#{i: xᵢ > 1 ∧ yᵢ > 1}"),
        ("any(hit)", "𝟙[∃i: hitᵢ]"),
        ("any(not hit)", "𝟙[∃i: ¬hitᵢ]"),
        ("any(gap == 1)", "𝟙[∃i: gapᵢ = 1]"),
        ("all(x' >= w)", "𝟙[∀i: x′ᵢ ≥ wᵢ]"),
        ("argmax(w * W[:, a])", "arg maxᵢ (wᵢW_(i, a))"),
        ("argmax([sum(W[k]) - w[k] for k in range(n)])", "arg maxₖ (∑_(i) W_(k, i) − wₖ)"),
        ("sum(x * (y if s > 1 else x))", "∑_(i) xᵢ ⋅ { yᵢ if s > 1; xᵢ otherwise }"),
        ("sum(onehot(a, n) * y)", "∑_(i) 𝟙[i = a] ⋅ yᵢ"),
        ("sum(min(x, y))", "∑_(i) min(xᵢ, yᵢ)"),
        ("sum(min(x) * y)", "∑_(i) min(x) ⋅ yᵢ"),
        ("sum(abs(x - w))", "∑_(i) |xᵢ − wᵢ|"),
        ("sum(clip(x, 0, w))", "∑_(i) clip(xᵢ, 0, wᵢ)"),
        ("sum(x * [2 * k for k in range(n)])", "∑_(i) xᵢ ⋅ (2i)"),
        ("sum(x * [1, 2, s])", "∑_(i) xᵢ ⋅ (1, 2, s)ᵢ"),
        ("sum(w[order] * x)", "∑_(i) w_(orderᵢ)xᵢ"),
        ("sum(x[1:] * 2)", "∑_(i) (x_(1: ))ᵢ ⋅ 2"),
        ("sum([sum(x * q) for q in y])", "∑_(q ∈ y) ∑_(i) xᵢq"),
        ("sum(B)", "∑_(i, j) B_(i, j)"),
        ("sum(W * B)", "∑_(i, j) W_(i, j)B_(i, j)"),
        ("count(B)", "#{(i, j): B_(i, j)}"),
        ("any(B[0])", "𝟙[∃i: B_(0, i)]"),
        ("where(x > y, x, y)", "({ xᵢ if xᵢ > yᵢ; yᵢ otherwise })ᵢ"),
        ("sum(where(x > y, x, w))", "∑_(i) { xᵢ if xᵢ > yᵢ; wᵢ otherwise }"),
        ("where(s > 1, x, y)", "{ x if s > 1; y otherwise }"),
        ("Normal(0, [1, 2, s])", "(𝒩(0, (1, 2, s)ᵢ²))ᵢ"),
        ("Normal(0, [[1, 2], [3, 4]])", "(𝒩(0, ([1 2; 3 4])_(i, j)²))_(i, j)"),
        ("Normal(x, std=w + 1)", "(𝒩(xᵢ, (wᵢ + 1)²))ᵢ"),
        ("Normal(x, s)", "𝒩(x, s²)"),
    ],
)
def test_the_index_is_on_what_has_elements(source: str, expected: str) -> None:
    assert written(source) == expected


def test_a_draw_inside_a_sum_has_as_many_elements_as_it_draws() -> None:
    left = writing().symbol("s", primed=True)
    alone = plain(writing().equation(left, parse(nowhere("sum(x * Bernoulli(1/2))"))))
    assert alone.startswith("s′ = ∑_(i) xᵢξ,")
    several = plain(writing().equation(left, parse(nowhere("sum(x * Bernoulli(1/2, shape=n))"))))
    assert several.startswith("s′ = ∑_(i) xᵢξᵢ,")


def test_names_of_the_task_are_no_indices() -> None:
    notation = of_task(writing().task)
    taken = Notation(notation.symbols | {"i": notation.symbol("i")}, axes=notation.axes)
    assert plain(mathematics(parse(nowhere("sum(x * w)")), taken)) == "∑_(j) xⱼwⱼ"


def test_axes_of_expressions() -> None:
    found = {
        source: rank(ExpressionWriter(writing().notation), parse(nowhere(source)))
        for source in ("x[0]", "W[0]", "W[:, 0]", "W[x]", "dot(W, x)", "dot(x, w)", "scan(f, 0, x)", "fold(f, 0, x)",
                       "x in {1, 2}", "[x, y]", "[1]", "{1, 2}", "near(x)", "near(2)", "Uniform({[1, 2], [3, 4]})")
    }  # fmt: skip
    assert found == {
        "x[0]": 0, "W[0]": 1, "W[:, 0]": 1, "W[x]": 2, "dot(W, x)": 1, "dot(x, w)": 0, "scan(f, 0, x)": 1, "fold(f, 0, x)": 0,
        "x in {1, 2}": 0, "[x, y]": 2, "[1]": 0, "{1, 2}": 0, "near(x)": 1, "near(2)": 1, "Uniform({[1, 2], [3, 4]})": 1,
    }  # fmt: skip
