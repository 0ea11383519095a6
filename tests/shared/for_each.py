"""Many small cases as one test, which names those that fail."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any


def for_each(names: str | Sequence[str], cases: Iterable[Any]) -> Callable[[Callable[..., None]], Any]:
    """Run a test for every case, as `pytest.mark.parametrize` does, and tell all cases that fail together."""
    keys = (names,) if isinstance(names, str) else tuple(names)
    every = list(cases)

    def decorated(test: Callable[..., None]) -> Callable[[], None]:
        def all_cases() -> None:
            wrong = []
            for case in every:
                values = (case,) if len(keys) == 1 else case
                try:
                    test(**dict(zip(keys, values, strict=True)))
                except Exception as error:
                    error.add_note(f"in the case {case!r}")
                    wrong.append(error)
            if wrong:
                raise ExceptionGroup(f"{len(wrong)} of {len(every)} cases", wrong)

        all_cases.__name__ = test.__name__
        all_cases.__doc__ = test.__doc__
        return all_cases

    return decorated
