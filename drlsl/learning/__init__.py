"""The learner: replay, networks, DQN, the trainer, evaluation and the folders of runs."""

import lazy_loader

from drlsl.errors import UserError

_attribute, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    """Return a name of the surface.

    Raises:
        UserError: PyTorch is not installed.
    """
    try:
        return _attribute(name)
    except ModuleNotFoundError as error:
        if error.name != "torch":
            raise
        raise UserError("learning needs PyTorch, which is missing: pip install 'drlsl[train]'") from error
