"""Completion of ids, paths and names in the shell."""

from __future__ import annotations

from pathlib import Path

MAX_OFFERED = 100

Completions = list[tuple[str, str]]  # continuations of a word, each with a remark


def starting(incomplete: str, known: Completions) -> Completions:
    """Select the completions that begin with the letters written so far."""
    return [each for each in known if each[0].startswith(incomplete)]


def complete_targets(incomplete: str) -> Completions:
    """Offer ids of known tasks, and specs and folders on disk."""
    from taskspec.language import registry

    known = list(registry.known().values())
    offered = starting(incomplete, [(entry.id, entry.path.name) for entry in known])
    if incomplete:
        offered += starting(incomplete, [(entry.name, entry.id) for entry in known])
    offered += complete_paths(incomplete)
    return offered[:MAX_OFFERED]


def complete_paths(incomplete: str) -> Completions:
    """Offer specs and folders on disk."""
    head, slash, tail = incomplete.rpartition("/")
    folder = Path(head + slash or ".")
    if not folder.is_dir():
        return []
    specs: Completions = []
    folders: Completions = []
    for path in sorted(folder.iterdir()):
        if not path.name.startswith(tail) or (not tail and path.name.startswith(".")):
            continue
        if path.is_dir():
            folders.append((f"{head}{slash}{path.name}/", "folder"))
        elif path.suffix in (".yaml", ".yml"):
            specs.append((f"{head}{slash}{path.name}", "spec"))
    return specs + folders


def complete_experiments(incomplete: str) -> Completions:
    """Offer the experiments that come with the suites, and files on disk."""
    from taskspec.learn.experiments.experiment_file import shipped

    known = [(name, path.name) for name, path in shipped().items()]
    return starting(incomplete, known) + complete_paths(incomplete)


def complete_learners(incomplete: str) -> Completions:
    """Offer the learners that come with the package, experiments, and files on disk."""
    from taskspec.learn.learners import BUILT_IN

    known = [(entry.name, entry.summary) for entry in BUILT_IN.values()]
    return starting(incomplete, known) + complete_experiments(incomplete)


def complete_modifiers(incomplete: str) -> Completions:
    """Offer modifiers, such as `sticky=`, with their meanings."""
    from taskspec.language.modifiers import MODIFIERS

    known = []
    for name, entry in MODIFIERS.items():
        if entry.arguments:
            name += "="
        known.append((name, entry.doc))
    return starting(incomplete, known)


def complete_policies(incomplete: str) -> Completions:
    """Offer names of policies, and files."""
    from taskspec.exact.policies.policy import NAMES

    return starting(incomplete, list(NAMES.items())) + complete_paths(incomplete)
