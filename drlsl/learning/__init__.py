"""The learner: replay, networks, DQN, the trainer, evaluation and the folders of runs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
