function inVectors2
include_global

V1 = Vector2_struct;
V1.iPindex = 4;               % tip of the follower
V1.jPindex = 8;               % on the ground

Vectors2 = [V1];
