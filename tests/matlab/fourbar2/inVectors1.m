function inVectors1
include_global

h = [1; 1; 0]/sqrt(2);        % 45 degrees from y

V1 = Vector1_struct; V1.Bindex = 1; V1.sp = [1; 0; 0];
V2 = Vector1_struct; V2.Bindex = 0; V2.sp = [1; 0; 0];
V3 = Vector1_struct; V3.Bindex = 2; V3.sp = h;
V4 = Vector1_struct; V4.Bindex = 0; V4.sp = h;

Vectors = [V1; V2; V3; V4];
