"""Register environments with Gymnasium and pictures with notebooks; import nothing that is not asked for."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pkgutil import resolve_name
from types import ModuleType
from typing import Any, Final

ENV_ID: Final = "drlsl/Highway-v0"


def register_with_gymnasium() -> None:
    """Register the environments now, or as soon as Gymnasium is imported."""
    if "gymnasium" in sys.modules:
        _register()
    else:
        sys.meta_path.insert(0, _WhenImported())


def _register() -> None:
    import gymnasium

    gymnasium.register(
        ENV_ID,
        entry_point="drlsl.driving.envs.single:HighwayEnv",
        vector_entry_point="drlsl.driving.envs.vector:HighwayVectorEnv",
    )


def register_with_ipython() -> None:
    """Have a scene shown as a picture if this is a notebook.

    The picture is drawn far above the room of scenes, so that the class itself cannot know it.
    """
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    if shell is not None:
        pictures = shell.display_formatter.formatters["image/png"]
        pictures.for_type_by_name("drlsl.driving.scene.model", "Scene", _scene_png)


def _scene_png(scene: Any) -> Any:
    return resolve_name("drlsl.driving.explain:scene_png")(scene)


class _WhenImported(MetaPathFinder):
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
            spec.loader = _ThenRegister(self, spec, spec.loader)
        return spec


class _ThenRegister(Loader):
    """Loads a module with its own loader, and registers the environments after."""

    def __init__(self, finder: MetaPathFinder, spec: ModuleSpec, loader: Loader) -> None:
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
