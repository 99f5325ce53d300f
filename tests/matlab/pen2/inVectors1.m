function inVectors1
include_global

V1 = Vector1_struct;
V1.Bindex = 1;
V1.sp = [0; 1; 0];
V2 = V1;
V2.Bindex = 2;

Vectors = [V1; V2];
