"""Vectors whose length is a parameter that may be 0: in the state, the reward and the observation of a spec that is made."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tests.verification.oracle.generator.spec import Draft

_FIRST: dict[str, tuple[Any, ...]] = {
    "bool": ("Bernoulli(1/2, shape=M)", "[i % 2 == 0 for i in range(M)]", "Subset(M, 0)"),
    "int": ("UniformInt(0, 1, shape=M)", "[i % 2 for i in range(M)]", "Permutation(M)", "0"),
    "real": ("[i / 4 for i in range(M)]", "[0.5 for i in range(M)]", "0"),
}
_NEXT = (
    "none", "reverse(none)", "none[::-1]", "[none[i] for i in range(M)]", "concat(none[:1], none[1:])", "none[none_at]",
    "none if t < 2 else reverse(none)", "reshape(reshape(none, (M, 1)), M)", "where(none == none, none, reverse(none))",
    "put(none, 0, none[0]) if M > 0 else none",
)  # fmt: skip
_PAID = (
    "sum(none)", "len(none)", "count(none == none)", "norm1(none)", "dot(none, none)", "sum(concat(none, 1))",
    "sum(cumsum(none)) + sum(argsort(none))", "sum(sort(none)[:1])", "sum(none[1:1])", "sum(onehot(t, M))",
    "all(none == none) + any(none != none)", "max(none) if M > 0 else 2", "(none[0] if M > 0 else 3) * 2",
    "argmin(none) if len(none) > 0 else 1", "sum(dot(reshape(none, (M, 1)), [2]))", "(t in {i for i in range(M)}) + 0",
    "sum([x + t for x in none_at])", "prod([1 + 0 * t for i in range(M)])", "sum([] if M == 0 else none)",
    "sum(UniformInt(0, 1, shape=M))", "Binomial(M, 1/2)", "sum(Categorical((1/2, 1/2), shape=M))", "count(Subset(M, M))",
)  # fmt: skip


def add(d: Draft) -> None:
    """A component of the state with M elements, how it goes on, and what it pays."""
    kind = d.rng.choice(("bool", "int", "real"))
    d.data.setdefault("parameters", {})["M"] = {
        "type": "int",
        "default": d.rng.choice((0, 0, 0, 2)),
        "low": 0,
        "high": 3,
    }
    d.data.setdefault("constants", {})["none_at"] = "[i for i in range(M)]"
    d.data["state"]["none"] = {"type": kind, "shape": ["M"]} | ({} if kind == "bool" else {"low": 0, "high": 3})
    d.data["initial"]["none"] = d.rng.choice(_FIRST[kind])
    if d.chance(0.7):
        d.data["dynamics"]["none'"] = d.rng.choice(_NEXT)
    if isinstance(d.data["reward"], str | int):
        d.data["reward"] = f"({d.data['reward']}) + ({d.rng.choice(_PAID)})"
    if "observation" in d.data and d.chance(0.5) and (kind != "real" or "space" not in d.data["observation"]):
        d.data["observation"]["none"] = "none"
