"""The paper's results, shown beside ours.

Source: arXiv:2307.01316, Table 1 (test results for 50 episodes) and section "Results and Discussion".
"""

from collections.abc import Mapping
from typing import Final, Literal

PaperMethod = Literal["DQN", "MPSDQN", "DQNSL"]
PaperTest = Literal["left_to_right", "right_to_left", "ngsim"]

METHODS: Final[tuple[PaperMethod, ...]] = ("DQN", "MPSDQN", "DQNSL")

TEST_LABELS: Final[Mapping[PaperTest, str]] = {
    "left_to_right": "highD, left to right",
    "right_to_left": "highD, right to left",
    "ngsim": "NGSIM US-101",
}

TABLE_1: Final[Mapping[PaperTest, Mapping[str, tuple[int, int, int]]]] = {
    "left_to_right": {
        "lane_changes": (204, 56, 43),
        "collisions": (14, 4, 1),
        "off_road": (0, 0, 0),
        "time_steps": (657, 607, 592),
    },
    "right_to_left": {
        "lane_changes": (115, 52, 48),
        "collisions": (5, 6, 2),
        "off_road": (33, 0, 0),
        "time_steps": (684, 619, 603),
    },
    "ngsim": {
        "lane_changes": (91, 15, 13),
        "collisions": (9, 5, 2),
        "off_road": (25, 0, 0),
        "time_steps": (971, 877, 852),
    },
}
"""By scenario and row, in the order of METHODS; the safety module is off. Source: Table 1."""

CONVERGENCE_EPISODE: Final[Mapping[PaperMethod, int]] = {"DQN": 970, "MPSDQN": 500, "DQNSL": 500}
"""Read off by the authors. Source: section "Results and Discussion", Training."""

COLLISION_REWARD: Final[Mapping[PaperMethod, float]] = {"DQN": -10.65, "MPSDQN": -2.26, "DQNSL": 0.0}
"""Mean per episode of training. Source: section "Results and Discussion", Training."""

OFF_ROAD_REWARD: Final[Mapping[PaperMethod, float]] = {"DQN": -60.1, "DQNSL": 0.0}
"""Mean per episode of training; MPSDQN's is not given. Source: section "Results and Discussion", Training."""


def table_1(test: PaperTest, row: str, method: PaperMethod) -> int:
    """Return a number of Table 1."""
    return TABLE_1[test][row][METHODS.index(method)]
