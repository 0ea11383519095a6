"""The smallest task, section by section, and the spec with some of them replaced or added."""

BASE = {
    "taskspec": "1",
    "name": "Walk",
    "state": "{s: {type: int, low: 0, high: 9}}",
    "action": "{a: {type: bool}}",
    "horizon": "9",
    "initial": "{s: 0}",
    "dynamics": "{s': 'min(s + a, 9)'}",
    "reward": "s' == 9",
}


def text(**sections: str) -> str:
    return "".join(f"{key}: {value}\n" for key, value in (BASE | sections).items())
