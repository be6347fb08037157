% What rules for a sled are made of: how far from the end of the ice it stops, and its speed.

:- dynamic at/1, speed/1.

learn(margin(_), more).
learn(next_speed(_), less).
learn(pushes(_), either).

change(brake, -1).
change(coast, 0).
change(push, 1).

pushes(push).

next_speed(Action, V) :- change(Action, Change), speed(V0), V is min(3, max(0, V0 + Change)).

margin(Action, Margin) :- next_speed(Action, V), at(X), Margin is 20 - X - V * (V + 1) // 2.
