"""Characters of mathematics and what TeX calls them: one table for reading and for writing."""

from __future__ import annotations

GREEK: dict[str, str] = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ϵ", "varepsilon": "ε", "zeta": "ζ",
    "eta": "η", "theta": "θ", "vartheta": "ϑ", "iota": "ι", "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν",
    "xi": "ξ", "pi": "π", "rho": "ρ", "sigma": "σ", "tau": "τ", "upsilon": "υ", "phi": "ϕ", "varphi": "φ",
    "chi": "χ", "psi": "ψ", "omega": "ω", "Gamma": "Γ", "Delta": "Δ", "Theta": "Θ", "Lambda": "Λ", "Xi": "Ξ",
    "Pi": "Π", "Sigma": "Σ", "Upsilon": "Υ", "Phi": "Φ", "Psi": "Ψ", "Omega": "Ω", "ell": "ℓ",
}  # fmt: skip

SYMBOLS: dict[str, str] = {
    "cdot": "⋅", "times": "×", "div": "÷", "pm": "±", "mp": "∓", "circ": "∘", "ast": "∗",
    "leq": "≤", "geq": "≥", "neq": "≠", "equiv": "≡", "approx": "≈", "sim": "∼", "propto": "∝", "ll": "≪",
    "gg": "≫", "in": "∈", "notin": "∉", "subset": "⊂", "subseteq": "⊆", "cup": "∪", "cap": "∩",
    "setminus": "∖", "land": "∧", "lor": "∨", "lnot": "¬", "forall": "∀", "exists": "∃", "to": "→",
    "leftarrow": "←", "uparrow": "↑", "downarrow": "↓", "leftrightarrow": "↔", "updownarrow": "↕", "nearrow": "↗",
    "searrow": "↘", "swarrow": "↙", "nwarrow": "↖", "mapsto": "↦", "Rightarrow": "⇒", "iff": "⟺", "star": "⋆",
    "bullet": "•", "infty": "∞", "ldots": "…", "cdots": "⋯",
    "vdots": "⋮", "partial": "∂", "nabla": "∇", "emptyset": "∅", "mid": "∣", "prime": "′", "langle": "⟨", "rangle": "⟩",
    "lfloor": "⌊", "rfloor": "⌋", "lceil": "⌈", "rceil": "⌉",
}  # fmt: skip

ACCENTS: dict[str, tuple[str, str]] = {
    "dot": ("˙", "\u0307"), "ddot": ("¨", "\u0308"), "hat": ("^", "\u0302"), "tilde": ("~", "\u0303"), "bar": ("¯", "\u0304"),
    "vec": ("→", "\u20d7"),
}  # fmt: skip
"""What TeX sets over a letter: the mark alone, and as a character that joins the one before it."""

ALIASES: dict[str, str] = {
    "le": "leq", "ge": "geq", "ne": "neq", "wedge": "land", "vee": "lor", "neg": "lnot", "gets": "leftarrow",
    "rightarrow": "to", "widehat": "hat", "widetilde": "tilde", "overline": "bar",
    "dots": "ldots", "dotsc": "ldots", "dotsb": "cdots", "implies": "Rightarrow",
}  # fmt: skip

DELIMITERS: dict[str, str] = {
    "(": "(", ")": ")", "[": "[", "]": "]", r"\{": "{", r"\}": "}", r"\lvert": "|", r"\rvert": "|",
    r"\lVert": "‖", r"\rVert": "‖", r"\lfloor": "⌊", r"\rfloor": "⌋", r"\lceil": "⌈", r"\rceil": "⌉",
    r"\langle": "⟨", r"\rangle": "⟩", ".": "",
}  # fmt: skip
"""How TeX writes what opens and closes."""

PAIRS: dict[str, str] = {"(": ")", "[": "]", "{": "}", "⌊": "⌋", "⌈": "⌉", "⟨": "⟩"}
LEFT_TEX: dict[str, str] = {v: k for k, v in DELIMITERS.items() if k not in (r"\rvert", r"\rVert")}
RIGHT_TEX: dict[str, str] = {v: k for k, v in DELIMITERS.items() if k not in (r"\lvert", r"\lVert")}

FUNCTIONS = frozenset({
    "arccos", "arcsin", "arctan", "arg", "cos", "cosh", "cot", "det", "dim", "exp", "gcd", "inf", "ker", "lim", "log",
    "ln", "max", "min", "sin", "sinh", "sup", "tan", "tanh", "Pr",
})  # fmt: skip
"""Names that TeX knows as upright functions."""

BLACKBOARD: dict[str, str] = {
    "R": "ℝ", "Z": "ℤ", "N": "ℕ", "Q": "ℚ", "C": "ℂ", "E": "𝔼", "P": "ℙ", "1": "𝟙",
}  # fmt: skip
CALLIGRAPHIC: dict[str, str] = {"S": "𝒮", "A": "𝒜", "N": "𝒩", "O": "𝒪", "T": "𝒯", "U": "𝒰", "D": "𝒟"}

TEX_LETTER: dict[str, str] = {char: name for name, char in GREEK.items()}
TEX_SYMBOL: dict[str, str] = {char: name for name, char in SYMBOLS.items()} | {"−": "-", "∼": "sim"}
