% comfort.properties.pl - what must hold in every scene for a comfortable driver, besides properties.pl: proved by
% drlsl rules verify --property comfort.properties.pl. The speed that is safe is another matter: it bounds what a comfortable driver does.
%
%   property(Name, Text), violates(Name)   a property, and that a scene breaks it, as in properties.pl

:- ensure_loaded('properties.pl').

property(comfort_in_limits, 'there is a comfortable acceleration, and the ego can reach it').
violates(comfort_in_limits) :- \+ comfortable_acceleration(_).
violates(comfort_in_limits) :- comfortable_acceleration(A), acceleration_limit(Most), A > Most.
violates(comfort_in_limits) :- comfortable_acceleration(A), braking_limit(Hardest), A < -Hardest.
