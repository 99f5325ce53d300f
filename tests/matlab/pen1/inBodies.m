function inBodies
include_global
% a solid cone, released level along y, spinning backwards about its axis

B1 = Body_struct;
B1.mass = 4;
B1.Jp = [0.0375 0 0  0 0.0270 0  0 0 0.0375];
B1.r = [0; 0.3; 0];
B1.p = [1; 0; 0; 0];
B1.r_dot = [0; 0; 0];
B1.w = [0; -10; 0];

Bodies = [B1];
