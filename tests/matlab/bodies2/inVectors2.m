function inVectors2
include_global

V1 = Vector2_struct; V1.iPindex = 2; V1.jPindex = 1;   % A to Q: the ground is the head
V2 = Vector2_struct; V2.iPindex = 3; V2.jPindex = 4;   % B to C
Vectors2 = [V1; V2];
