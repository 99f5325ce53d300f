function inBodies
include_global
% masses do not change the motion: the motor rules it

B1 = Body_struct;              % crank
B1.mass = 1;
B1.Jp = diag([0.5 0.5 0.1]);
B1.r = [0; 0; 1];

B2 = Body_struct;              % follower
B2.mass = 3;
B2.Jp = diag([12 12 0.3]);
B2.r = [0.0025008934957; 3.9974991065043; 3.49999821300861];
B2.p = [0.99999987235775; 0.00035727054499; 0.00035727054499; 0];

Bodies = [B1; B2];
