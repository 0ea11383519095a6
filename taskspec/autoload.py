"""Makes `gym.make("derail/...")` work without `import taskspec`, also on Gymnasium 1.x, which reads no entry points.

`taskspec-autoload.pth`, installed beside the package, imports the package whenever Python starts. That costs about a
millisecond: nothing is read until `gymnasium.envs.registration` is imported, and then the shipped tasks are registered.
Set TASKSPEC_NO_AUTOLOAD=1 to switch it off; `taskspec.making.register_shipped()` does the same by hand.
"""

import os
import sys

TARGET = "gymnasium.envs.registration"


class _Waiting:
    """A finder that finds nothing itself: it lets the target be found, and acts once the target has been executed."""

    def find_spec(self, name, path=None, target=None):  # type: ignore[no-untyped-def]
        if name != TARGET or self not in sys.meta_path:
            return None
        sys.meta_path.remove(self)
        from importlib.util import find_spec

        spec = find_spec(name)
        if spec is not None and spec.loader is not None:
            _act_after(spec.loader)
        return spec


def _act_after(loader) -> None:  # type: ignore[no-untyped-def]
    execute = loader.exec_module

    def exec_module(module) -> None:  # type: ignore[no-untyped-def]
        execute(module)
        try:
            from taskspec.making import register_shipped

            register_shipped()
        except Exception as error:  # a broken installation of ours must not break `import gymnasium`
            sys.stderr.write(f"taskspec: its tasks could not be registered ({error})\n")

    loader.exec_module = exec_module


if not os.environ.get("TASKSPEC_NO_AUTOLOAD"):
    if TARGET in sys.modules:
        from taskspec.making import register_shipped

        register_shipped()
    else:
        sys.meta_path.insert(0, _Waiting())
