"""Comprehensions and joined vectors as mathematics: what variables go through, and one list of what is joined."""

import pytest

from tests.show.printers.test_mathematics import written


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("count([x > i for i in range(3)])", r"\text{\#}\{i \in \{0, 1, 2\} : \,x > i\}"),
        ("count([v > 1 for v in s])", r"\sum_{v \in s} \taskspecone [v > 1]"),
        (
            "count([x > i * j for i in range(3) for j in range(2)])",
            r"\text{\#}\{i \in \{0, 1, 2\}, j \in \{0, 1\} : \,x > ij\}",
        ),
        ("all([x > i for i in range(L)])", r"\taskspecone [\forall i \in \{0, \ldots , L - 1\} : \,x > i]"),
        (
            "any([x > i for i in range(L) if i > 1])",
            r"\taskspecone [\exists i \in \{0, \ldots , L - 1\}, i > 1 : \,x > i]",
        ),
        ("not all([x > i for i in range(3)])", r"\taskspecone [\lnot (\forall i \in \{0, 1, 2\} : \,x > i)]"),
        ("x - sum([v + 1 for v in s])", r"x - \sum_{v \in s} (v + 1)"),
        ("sum([i for i in range(3) if x > i])", r"\sum_{i \in \{0, 1, 2\}, x > i} i"),
        ("prod([i + j for i in range(3) for j in range(2)])", r"\prod_{i \in \{0, 1, 2\}, j \in \{0, 1\}} (i + j)"),
        ("{i for i in range(1, 9)}", r"\{1, \ldots , 8\}"),
        ("{i for i in range(1, 9, 2)}", r"\mathrm{range}(1, 9, 2)"),
    ],
)
def test_variables_go_through_their_domain(source: str, expected: str) -> None:
    assert written(source) == expected


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("concat([x], s)", r"(x, s)"),
        ("concat([x, x + 1], concat(s, [1]))", r"(x, x + 1, s, 1)"),
        ("concat([[1, 2]], [[3, x]])", r"\begin{pmatrix} 1 & 2 \\ 3 & x \end{pmatrix}"),
    ],
)
def test_what_is_joined_is_one_list(source: str, expected: str) -> None:
    assert written(source) == expected
