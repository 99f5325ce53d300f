function inBodies
include_global
a = 0.5;  b = 0.2;  c = 0.1;   % half length of the rod, of the cylinder, and the gap

B1 = Body_struct;              % rod
B1.mass = 0.5;
B1.Jp = [0.0417 0 0; 0 0.001 0; 0 0 0.0417];
B1.r = [0; a; 0];

B2 = Body_struct;              % cylinder
B2.mass = 10;
B2.Jp = [0.2333 0 0; 0 0.2 0; 0 0 0.2333];
B2.r = [0; 1.3; 0];            % 2*a + c + b
B2.w = [0; 25; 0];

Bodies = [B1; B2];
