function inVectors2
include_global

V1 = Vector2_struct; V1.iPindex = 2; V1.jPindex = 3;   % the coupler
V2 = Vector2_struct; V2.iPindex = 3; V2.jPindex = 6;   % the spring

Vectors2 = [V1; V2];
