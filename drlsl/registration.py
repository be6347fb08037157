"""Register environments with Gymnasium and pictures with notebooks; import nothing that is not asked for."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pkgutil import resolve_name
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final, cast

if TYPE_CHECKING:  # importlib.abc takes longer to load than the rest of this module
    from importlib.abc import Loader

ENV_IDS: Final = {
    "drlsl/Highway-v0": ("single:HighwayEnv", "vector:HighwayVectorEnv"),
    "drlsl/Merge-v0": ("merge:MergeEnv", "merge:MergeVectorEnv"),
}
"""The environments: modules and classes of the single one and of the vector one, in `drlsl.driving.envs`."""

_SHOWN: Final = (
    ("image/png", "drlsl.driving.scene.model", "Scene", "drlsl.driving.explain:scene_png"),
    ("text/html", "drlsl.driving.episodes.driven_episode", "Episode", "drlsl.driving.page:framed_page"),
)
"""Media type, module and class of what a notebook shows, and the function that makes it."""


def register_with_gymnasium() -> None:
    """Register the environments now, or as soon as Gymnasium is imported."""
    if "gymnasium" in sys.modules:
        _register()
    else:
        sys.meta_path.insert(0, _WhenImported())


def _register() -> None:
    import gymnasium

    for name, (single, vector) in ENV_IDS.items():
        gymnasium.register(
            name,
            entry_point=f"drlsl.driving.envs.{single}",
            vector_entry_point=f"drlsl.driving.envs.{vector}",
        )


def register_with_ipython() -> None:
    """Have scenes and episodes shown if this is a notebook.

    They are drawn in rooms above their own, so that their classes cannot know how.
    """
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    if shell is None:
        return
    for kind, module, name, shown_by in _SHOWN:
        formatter = shell.display_formatter.formatters[kind]
        formatter.for_type_by_name(module, name, partial(_show, shown_by))


def _show(shown_by: str, value: Any) -> Any:
    return resolve_name(shown_by)(value)


class _WhenImported:
    """Finds Gymnasium as usual, and has the environments registered when it is loaded.

    It stays until then: libraries look for Gymnasium to see whether it is there, and do not load it.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname != "gymnasium":
            return None
        sys.meta_path.remove(self)
        try:
            spec = find_spec(fullname)
        finally:
            sys.meta_path.insert(0, self)
        if spec is not None and spec.loader is not None:
            spec.loader = cast("Loader", _ThenRegister(self, spec, spec.loader))
        return spec


class _ThenRegister:
    """Loads a module with its own loader, and registers the environments after."""

    def __init__(self, finder: _WhenImported, spec: ModuleSpec, loader: Loader) -> None:
        self._finder = finder
        self._spec = spec
        self._loader = loader

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        self._spec.loader = module.__loader__ = self._loader
        self._loader.exec_module(module)
        if self._finder in sys.meta_path:
            sys.meta_path.remove(self._finder)
        _register()
