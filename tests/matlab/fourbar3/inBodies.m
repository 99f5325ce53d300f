function inBodies
include_global
% masses do not change the motion: the motor rules it

B1 = Body_struct;              % crank
B1.mass = 1;
B1.Jp = diag([0.5 0.5 0.1]);
B1.r = [0; 0; 1];

B2 = Body_struct;              % coupler
B2.mass = 2;
B2.Jp = diag([7 7 0.2]);
B2.r = [0.0025008934957; 1.9974991065043; 4.49999821300861];
B2.p = [0.94372914762729; -0.3307191304138; ...
        0.0003687760074; -0.00012923335132];

B3 = Body_struct;              % follower
B3.mass = 3;
B3.Jp = diag([12 12 0.3]);
B3.r = [0.0025008934957; 3.9974991065043; 3.49999821300861];
B3.p = [0.99999987235775; 0.00035727054499; 0.00035727054499; 0];

Bodies = [B1; B2; B3];
