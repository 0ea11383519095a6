"""Mathematics as people write it: one tree, LaTeX and MathML from it, and no text that can become a command."""

import re
from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskspec.exact import MEASURES
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.dists import DISTS
from taskspec.language.expressions.operators import FUNCTIONS
from taskspec.language.expressions.parse import parse
from taskspec.show.printers import latex, mathematics, mathml, plain
from taskspec.show.printers import tree as m
from taskspec.show.printers.expressions import condition
from taskspec.show.printers.markup import escape
from taskspec.show.printers.names import Notation, expression, nowhere, symbol
from taskspec.show.printers.rewrites import substitute
from taskspec.show.printers.tex import CALLIGRAPHIC, mended
from taskspec.show.printers.tex import read as read_tex
from taskspec.show.printers.text import text
from tests.shared.for_each import for_each

PLACE = s.Place(nowhere(""), 0, 0)
N = Notation(
    symbols={name: symbol(name) for name in ("s", "a", "L", "B", "M", "x", "y", "theta", "p", "mean", "c")},
    lengths={"s": parse(nowhere("2 * L")), "p": parse(nowhere("K"))},
    labels={"move": {"up": m.Ident("U")}},
    axes={"W": 2},
)


def written(source: str) -> str:
    return re.sub(r" *\\allowbreak *", " ", latex(mathematics(parse(nowhere(source)), N)))


@for_each(
    ("source", "expected"),
    [
        ("L * B", "LB"),
        ("2 * L + 1", "2L + 1"),
        ("s + (a + 1) * (s % B == 0)", r"s + (a + 1) \cdot \taskspecone [s \equiv 0\,\,(\mathrm{mod}\,B)]"),
        ("M // 2", r"\lfloor M / 2 \rfloor"),
        ("(x + 1) / y", r"\frac{x + 1}{y}"),
        ("-x * y / 2", r"- \frac{xy}{2}"),
        ("(x / y)**2", r"\left( \frac{x}{y} \right)^2"),
        ("-(y' - x)**2", "- (y' - x)^2"),
        ("x - (y - a)", "x - (y - a)"),
        ("B**-L", "B^{- L}"),
        ("x**2 * y", "x^2y"),
        ("theta**2", r"\theta^2"),
        ("sum(s[:L])", r"\sum_{i = 0}^{L - 1} s_i"),
        ("sum(s[L:])", r"\sum_{i = L}^{2L - 1} s_i"),
        ("sum(s)", r"\sum_{i = 0}^{2L - 1} s_i"),
        ("sum(s[:-1])", r"\sum_{i = 0}^{2L - 2} s_i"),
        ("sum(s[-3:])", r"\sum_{i = 2L - 3}^{2L - 1} s_i"),
        ("s[-1]", "s_{2L - 1}"),
        ("s[-0]", "s_{- 0}"),
        ("s[:L]", r"s_{\{0, \ldots , L - 1\}}"),
        ("s[a:a + 3]", r"s_{\{a, \ldots , a + 2\}}"),
        ("s[1:3]", r"s_{\{1, 2\}}"),
        ("s[1:-1]", r"s_{\{1, \ldots , 2L - 2\}}"),
        ("x[:, -2]", r"x_{: , \lvert x_0 \rvert - 2}"),
        ("argmax(p)", r"\arg\max_i\,p_i"),
        ("count(v == sort(v))", r"\text{\#}\{i : \,v_i = {\mathrm{sort}(v)}_i\}"),
        ("argmax(W[0])", r"\arg\max_i\,W_{0, i}"),
        ("sum(W)", r"\sum_{i, j} W_{i, j}"),
        ("norm1(x - y)", r"\lVert x - y \rVert_1"),
        ("x * sin(y)", r"x\,\sin (y)"),
        ("abs(x)", r"\lvert x \rvert"),
        ("exp(-x)", "e^{- x}"),
        ("mean[c, a]", r"\mathrm{mean}_{c, a}"),
        ("where(x > y, x, y)", r"\begin{cases} x & \text{if }x > y \\ y & \text{otherwise} \end{cases}"),
        ("x if x > y else y", r"\begin{cases} x & \text{if }x > y \\ y & \text{otherwise} \end{cases}"),
        ("Uniform({p for p in box(-B, B, 2) if norm1(p) <= B})",
         r"\mathrm{Unif}\{p \in \{- B, \ldots , B\}^2 : \,\lVert p \rVert_1 \leq B\}"),
        ("UniformInt(0, 1)", r"\mathrm{Unif}\{0, 1\}"),
        ("Normal(mean=0, std=1, shape=L)", r"{\mathcal{N}(0, 1)}^L"),
        ("move == up", r"\taskspecone [\mathrm{move} = U]"),
        ("x in {1, 2}", r"\taskspecone [x \in \{1, 2\}]"),
        ("1e-3", "10^{- 3}"),
        ("any((x == 1, y == 2))", r"\taskspecone [x = 1 \lor y = 2]"),
        ("sum(s * s)", r"\sum_{i} s_is_i"),
        ("Normal(shape=(L + 1, 2))", r"{\mathcal{N}(0, 1)}^{(L + 1) \times 2}"),
        ("Normal(shape=L + 1)", r"{\mathcal{N}(0, 1)}^{L + 1}"),
    ],
)  # fmt: skip
def test_hand_writing(source: str, expected: str) -> None:
    assert written(source) == expected


# Brackets: where they are needed for what is meant, where a reader would need them, and nowhere else. Read off the output,
# and checked by eye.
@for_each(
    ("source", "expected"),
    [
        ("not (x < y)", r"\taskspecone [x \geq y]"),
        ("not (x + y)", r"\taskspecone [\lnot (x + y)]"),
        ("not (x < y < a)", r"\taskspecone [\lnot (x < y < a)]"),
        ("(x or y) and a", r"\taskspecone [(x \lor y) \land a]"),
        ("x or y and a", r"\taskspecone [x \lor (y \land a)]"),
        ("not x and y", r"\taskspecone [\lnot x \land y]"),
        ("not (x and y)", r"\taskspecone [\lnot (x \land y)]"),
        ("(x * y) % a", r"(xy) \bmod a"),
        ("x * (y % a)", r"x \cdot (y \bmod a)"),
        ("-(x % y)", r"- (x \bmod y)"),
        ("(-x) % y", r"(- x) \bmod y"),
        ("-x**2", r"- x^2"),
        ("(-x)**2", r"(- x)^2"),
        ("x**-y", r"x^{- y}"),
        ("x**y**a", r"x^{y^a}"),
        ("(x**y)**a", r"(x^y)^a"),
        ("2 - -x", r"2 - (- x)"),
        ("x + -y", r"x + (- y)"),
        ("x + (-y + a)", r"x + (- y + a)"),
        ("x - (y + a)", r"x - (y + a)"),
        ("x - -y * a", r"x - (- ya)"),
        ("- -x", r"- (- x)"),
        ("x * -y", r"x \cdot (- y)"),
        ("-x * y", r"- xy"),
        ("-(x * y)", r"- xy"),
        ("x / (y / a)", r"\frac{x}{\frac{y}{a}}"),
        ("(x / y) * a", r"\frac{x}{y}a"),
        ("sum(s) * i", r"\left( \sum_{i = 0}^{2L - 1} s_i \right) \cdot i"),
        ("prod(s) * x", r"\left( \prod_{i = 0}^{2L - 1} s_i \right) \cdot x"),
        ("x * sum(s)", r"x \cdot \left( \sum_{i = 0}^{2L - 1} s_i \right)"),
        ("sum(s) % x", r"\left( \sum_{i = 0}^{2L - 1} s_i \right) \bmod x"),
        ("-sum(s)", r"- \sum_{i = 0}^{2L - 1} s_i"),
        ("argmax(p) + 1", r"(\arg\max_i\,p_i) + 1"),
        ("argmax(p) == 2", r"\taskspecone [\arg\max_i\,p_i = 2]"),
        ("x and all(p > 0)", r"\taskspecone [x \land (\forall i : \,p_i > 0)]"),
        ("all(p > 0) and x", r"\taskspecone [(\forall i : \,p_i > 0) \land x]"),
        ("exp(x)**2", r"(e^x)^2"),
        ("(x // y)**2", r"\lfloor x / y \rfloor^2"),
        ("x // (y * a)", r"\lfloor x / (ya) \rfloor"),
        ("x // (y / a)", r"\left\lfloor x / \frac{y}{a} \right\rfloor"),
        ("sqrt(x)**2", r"\sqrt{x}^2"),
        ("abs(x)**2", r"\lvert x \rvert^2"),
        ("(s[1:])[i]", r"(s_{1 :})_i"),
        ("s'[i]**2", r"s_i^{\prime 2}"),
        ("put(x + y, 0, 1)", r"(x + y)[0 \leftarrow 1]"),
        ("dot(x + y, -a)", r"(x + y) \cdot (- a)"),
        ("x + dot(-y, a)", r"x + (- y \cdot a)"),
        ("Normal(0, x + 1)", r"\mathcal{N}(0, (x + 1)^2)"),
        ("Normal(x, y) + 1", r"\mathcal{N}(x, y^2) + 1"),
        ("(x if a else y)**2", r"\left( \begin{cases} x & \text{if }a \\ y & \text{otherwise} \end{cases} \right)^2"),
        ("(x if a else y) * 2", r"\begin{cases} x & \text{if }a \\ y & \text{otherwise} \end{cases} \cdot 2"),
        ("x if a else y if c else 2", r"\begin{cases} x & \text{if }a \\ y & \text{if }c \\ 2 & \text{otherwise} \end{cases}"),
        ("(x if a else y) if c else 2",
         r"\begin{cases} \begin{cases} x & \text{if }a \\ y & \text{otherwise} \end{cases} & \text{if }c \\ "
         r"2 & \text{otherwise} \end{cases}"),
        ("x < y <= a", r"\taskspecone [x < y \leq a]"),
        ("(x < y) == a", r"\taskspecone [\taskspecone [x < y] = a]"),
        ("x < (y < a)", r"\taskspecone [x < \taskspecone [y < a]]"),
        ("x == (y or a)", r"\taskspecone [x = \taskspecone [y \lor a]]"),
        ("1e-3 * x", r"10^{- 3} \cdot x"),
        ("x**1e-3", r"x^{10^{- 3}}"),
        ("2.5e6**2", r"(2.5 \times 10^6)^2"),
        ("sum([i * x for i in range(2 * L)])", r"\sum_{i = 0}^{2L - 1} ix"),
        ("x if not (a or y) else 0", r"\begin{cases} x & \text{if } \lnot (a \lor y) \\ 0 & \text{otherwise} \end{cases}"),
        ("{0: x, 1: 1 - x}", r"\begin{cases} 0 & \text{with probability }x \\ 1 & \text{with probability }1 - x \end{cases}"),
        ("clip(x, -1, 1)", r"\mathrm{clip}(x, - 1, 1)"),
        ("1 if s[i] else 0", r"\begin{cases} 1 & \text{if }s_i \\ 0 & \text{otherwise} \end{cases}"),
        ("norm2(s)**2", r"\lVert s \rVert_2^2"),
    ],
)  # fmt: skip
def test_brackets(source: str, expected: str) -> None:
    assert written(source) == expected


@pytest.mark.parametrize(
    ("source", "expected"),
    [("x / y * a", "(x/y)a"), ("2 * (x / y)", "2 ⋅ x/y"), ("a % (x / y)", "a mod (x/y)"), ("s[s[0]]", "s_(s₀)"),
     ("2**2**2", "2^(2²)"), ("-x / y", "−x/y"), ("x / (y * a)", "x/(ya)"), ("s[i + 1]**2", "sᵢ₊₁²")],
)  # fmt: skip
def test_brackets_in_a_line_of_text(source: str, expected: str) -> None:
    assert plain(mathematics(parse(nowhere(source)), N)) == expected


@pytest.mark.parametrize(
    "source",
    ["x[i + 1, 2 * L + 3]", "x**(2 * L + 3)", "x if x > y else y", "sqrt(x + y)", "[[1, 2], [x, y]]", "abs(x)", "sum(s[:L])",
     "norm2(s)**2", "-x", "x' + 1", "clip(x, 0, L)", "Normal(0, x + 1)"],
)  # fmt: skip
def test_widths_are_about_those_of_a_line_of_text(source: str) -> None:
    """For what does not stand on two lines."""
    tree = mathematics(parse(nowhere(source)), N)
    assert 0.4 < m.width(tree) / len(plain(tree)) < 1.6


def tabulated(rows: dict[str, Any]) -> s.Table:
    """A table by x and y."""

    def body(inner: Any) -> Any:
        return parse(nowhere(inner)) if isinstance(inner, str) else lines(inner)

    def lines(some: dict[str, Any]) -> tuple[s.TableRow, ...]:
        return tuple(s.TableRow(None if k == "else" else parse(nowhere(k)), body(v), PLACE) for k, v in some.items())

    return s.Table((parse(nowhere("x")), parse(nowhere("y"))), lines(rows), PLACE)


def test_rows_of_a_table_keep_their_order_where_it_matters() -> None:
    """x = 2 gives 1 whatever y is, so that this line stands before the one that only asks for y, though `else` says 1 as well."""
    rows = {"else": {"2": "0", "else": "1"}, "2": {"else": "1"}, "3": {"1": "0", "2": "5", "else": "1"}}
    assert latex(mathematics(tabulated(rows), N)) == (
        r"\begin{cases} 1 & \text{if }x = 2 \\ 0 & \text{if }x = 3 \land y = 1 \\ 5 & \text{if }x = 3 \land y = 2 \\ "
        r"1 & \text{if }x = 3 \\ 0 & \text{if }y = 2 \\ 1 & \text{otherwise} \end{cases}"
    )


def test_a_condition_is_an_indicator_only_as_a_number() -> None:
    expr = parse(nowhere("x == y"))
    assert latex(condition(expr, N)) == "x = y"
    assert latex(mathematics(expr, N)).startswith(r"\taskspecone")


@for_each("name", sorted(FUNCTIONS))
def test_every_function_has_mathematics(name: str) -> None:
    arguments = [a.lstrip("*") for a in FUNCTIONS[name].arguments]
    tree = mathematics(parse(nowhere(f"{name}({', '.join(arguments)})")), Notation())
    _is_well_formed(tree)
    assert "{" not in plain(tree).replace("{ ", "").replace("#{", "").replace(" }", "") or name in ("where", "count")


@pytest.mark.parametrize("name", sorted(DISTS))
def test_every_distribution_has_mathematics(name: str) -> None:
    arguments = ", ".join(a.name for a in DISTS[name].arguments)
    _is_well_formed(mathematics(parse(nowhere(f"{name}({arguments})")), Notation()))


def _is_well_formed(tree: m.Math) -> None:
    ElementTree.fromstring(mathml(tree))
    source = latex(tree)
    assert source.count("{") - source.count(r"\{") == source.count("}") - source.count(r"\}")
    assert not _holes(tree)


def _holes(tree: m.Math) -> bool:
    return isinstance(tree, m.Hole) or any(_holes(child) for child in m.children(tree))


@pytest.mark.parametrize(
    ("name", "expected"),
    [("theta", r"\theta"), ("c2", "c_2"), ("s_0", "s_0"), ("x_limit", r"x_{\mathrm{limit}}"), ("move", r"\mathrm{move}"),
     ("half_length", r"\text{half-length}"), ("inf", r"\infty")],
)  # fmt: skip
def test_symbols_of_names(name: str, expected: str) -> None:
    assert latex(symbol(name)) == expected


@for_each(
    ("source", "tex", "text"),
    [(r"\dot\theta", r"\dot{\theta}", "θ̇"), (r"\hat{x}_t", r"\hat{x}_t", "x̂ₜ"), (r"\overline x'", r"\bar{x}'", "x̄′"),
     (r"\frac12", r"\frac{1}{2}", "1/2"), (r"\frac1{23}", r"\frac{1}{23}", "1/23"), (r"\frac{12}x", r"\frac{12}{x}", "12/x"),
     (r"\uparrow", r"\uparrow", " ↑ "), ("↔", r"\leftrightarrow", " ↔ "),
     (r"\sum_i^{2n} x_i", r"\sum_{i}^{2n} x_i", "∑_(i)^(2n) xᵢ"),
     (r"\prod^n x", r"\prod^{n} x", "∏^(n) x"), (r"\sqrt{x} y", r"\sqrt{x}y", "√(x)y"), ("a~b", r"a\,b", "a b"),
     (r"\begin{cases} a & b \\ c \end{cases} + 1", r"\begin{cases} a & b \\ c & \end{cases} + 1", "{ a b; c } + 1"),
     (r"\begin{pmatrix} a & b \\ c & d \end{pmatrix} x", r"\begin{pmatrix} a & b \\ c & d \end{pmatrix}x", "[a b; c d]x"),
     (r"\mathit{αx}", r"\mathit{\alpha x}", "αx"),
     ("{a}" * 50, "a" * 50, "a" * 50), ("(a)" * 50, "(a)" * 50, "(a)" * 50), (r"\left( x \right] y", "(x]y", "(x]y"),
     (r"\mathbb R", r"\mathbb{R}", "ℝ")],
)  # fmt: skip
def test_symbols_that_authors_give(source: str, tex: str, text: str) -> None:
    found = read_tex(source)
    assert (latex(found), plain(found)) == (tex, text)
    ElementTree.fromstring(mathml(found))


def test_arrows_are_text_as_well() -> None:
    assert escape("↑↗") == r"\ensuremath{\uparrow}\ensuremath{\nearrow}"


def test_parameters_become_values() -> None:
    found = substitute(parse(nowhere("(a + 1) * (s % B == 0) + L * B - B**2")), {"L": 5, "B": 3})
    assert text(found) == "(a + 1) * (s % 3 == 0) + 15 - 9"


@pytest.mark.parametrize(
    ("source", "expected"),
    [("one * x", "x"), ("x * one", "x"), ("x + zero", "x"), ("zero + x", "x"), ("x - zero", "x"), ("zero - x", "0 - x"),
     ("zero * x", "0 * x"), ("x * half", "x * 0.5"), ("x + less", "x + -2"), ("max(zero, x)", "max(0, x)"),
     ("7 // zero", "0"), ("6 / (one + one)", "3"), ("7 / (one + one)", "7 / 2"), ("one / zero", "1 / 0")],
)  # fmt: skip
def test_what_a_value_does_to_arithmetic(source: str, expected: str) -> None:
    assert text(substitute(parse(nowhere(source)), {"zero": 0, "one": 1, "half": 0.5, "less": -2})) == expected


def test_a_vector_in_a_declaration_is_an_expression() -> None:
    assert text(expression([1, "L + 1", [0.5, True]])) == "(1, L + 1, (0.5, True))"


def test_delimiters_of_a_matrix_in_mathml() -> None:
    found = ElementTree.fromstring(mathml(mathematics(parse(nowhere("[[1, 2], [x, y]]")), N)))
    assert [(mo.text, mo.get("form")) for mo in found.iter("mo")] == [("(", "prefix"), (")", "postfix")]
    assert [[cell[0].text for cell in line] for line in found.iter("mtr")] == [["1", "2"], ["x", "y"]]


DANGEROUS = re.compile(
    r"\\(?:input|include|write|openout|def|let|catcode|csname|immediate|read|special|usepackage|expandafter)"
)


@given(st.text(alphabet=st.sampled_from("\\{}[]()$&#%_^~<>\"'`|abcinputwrite18 \n;,.-+=/*"), max_size=60))
def test_no_tex_can_smuggle_a_command(source: str) -> None:
    found = latex(read_tex(source))
    assert not DANGEROUS.search(found)
    assert _is_balanced(found)
    ElementTree.fromstring(mathml(read_tex(source)))


@given(st.text(max_size=60))
def test_escaped_text_holds_no_command_of_its_own(source: str) -> None:
    found = escape(source)
    assert not DANGEROUS.search(found)
    assert _is_balanced(found)
    assert not re.search(r"(?<!\\)[$&#%_^~](?!\{)", found.replace("~", ""))


def _is_balanced(source: str) -> bool:
    depth = 0
    for piece in re.findall(r"\\.|[{}]", source, re.DOTALL):
        depth += {"{": 1, "}": -1}.get(piece, 0)
        if depth < 0:
            return False
    return depth == 0


COMMANDS = [r"\input{x}", r"\write18{rm}", r"\def\a{}", r"\csname x\endcsname", r"^^5cinput", r"$\input$"]


@pytest.mark.parametrize("source", COMMANDS)
def test_unknown_commands_are_shown_as_text(source: str) -> None:
    found = latex(read_tex(source))
    assert not DANGEROUS.search(found)
    assert "^^" not in found


def test_reading_tex_takes_linear_time() -> None:
    for opener in ("(", "{", r"\left(", r"\frac{", r"\sqrt{", "_{", r"\begin{cases}"):
        latex(read_tex(opener * 300))


@for_each("name", MEASURES)
def test_formulas_of_measures_are_mathematics_in_full(name: str) -> None:
    assert "\\" not in mathml(read_tex(MEASURES[name].formula))


@for_each(("tex", "words"), [
    (r"\frac{1}{2}", ""), ("c_0", ""), (r"\beta", ""), (r"\hat{x}_{i+1}'", ""), (r"\text{100 \%}", ""), (r"\left( x \right.", ""),
    (r"\mathcal{S}", ""), ("[0, 1)", ""), (r"\frac{1", "not closed"), (r"\frac{1}", "argument"), ("x_{1", "not closed"),
    ("$", "out of place"), ("$x$", "out of place"), ("x}", "out of place"), (r"\hat", "argument"), (r"\upp", "not known"),
    (r"\mathbf{x", "not closed"), (r"\text{x", "not closed"), (r"\left( x", "no `\\right`"), ("x^", "argument"),
])  # fmt: skip
def test_what_is_no_tex_is_told(tex: str, words: str) -> None:
    told = "; ".join(mended(tex))
    assert words in told
    assert bool(told) == bool(words)


def test_sets_are_printed_apart_from_names() -> None:
    """A constant `S` is not the set of states, on the terminal as elsewhere."""
    for letter in CALLIGRAPHIC:
        trees = (m.Ident(letter), m.Ident(letter, "calligraphic"))
        for printed in (plain, latex, mathml):
            assert printed(trees[0]) != printed(trees[1])
