"""The answers about N scenes, put together: a plain function, compiled to machine code where it is used."""

from __future__ import annotations

from drlsl.driving.shield.decision import is_speed, is_wish
from drlsl.lowering.backends import Floats1, Floats2, Integers1, Mask1, Mask2


def gather(
    undecided: Mask1,
    derived: Mask2,
    actions: Integers1,
    speed: Floats1,
    speed_fails: Mask1,
    observation: Floats2,
    observation_fails: Mask1,
    comfort: Floats1,
    comfort_fails: Mask1,
    lane_fails: Mask1,
    low: Floats1,
    high: Floats1,
    mask: Mask2,
    doubtful: Mask1,
) -> bool:
    """Write the masks of `actions` (A,), derived or not (N, A), and in which scenes a `Decision` is lacking.

    That is where one of the first answers fails, no action is offered, or a number is out of its bounds.
    Return whether there is such a scene.
    """
    any_doubtful = False
    for scene in range(len(undecided)):
        offered = False
        for action in range(mask.shape[1]):
            mask[scene, action] = False
        for column in range(len(actions)):
            mask[scene, actions[column]] |= derived[scene, column]
            offered |= derived[scene, column]
        inside = True
        for place in range(len(low)):
            inside &= (observation[scene, place] >= low[place]) & (observation[scene, place] <= high[place])
        fails = speed_fails[scene] | observation_fails[scene] | comfort_fails[scene] | lane_fails[scene]
        usable = offered & inside & is_speed(speed[scene]) & is_wish(comfort[scene])
        doubtful[scene] = undecided[scene] | fails | (not usable)
        any_doubtful |= doubtful[scene]
    return any_doubtful
