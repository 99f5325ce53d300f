function inBodies
include_global
% x forward, y to the left, z up; every frame is parallel to x-y-z at the start

B1 = Body_struct;              % frame
B1.mass = 20;
B1.Jp = diag([0.9 1.2 1.8]);
B1.r = [0; 0; 0.325];

B2 = Body_struct;              % steering fork
B2.mass = 2;
B2.Jp = diag([0.05 0.05 0.02]);
B2.r = [0.5; 0; 0.325];

B3 = Body_struct;              % front wheel
B3.mass = 1;
B3.Jp = diag([0.01 0.02 0.01]);
B3.r = [0.5; 0; 0.2];

B4 = B3;                       % left rear wheel
B4.r = [-0.2; 0.3; 0.2];

B5 = B3;                       % right rear wheel
B5.r = [-0.2; -0.3; 0.2];

Bodies = [B1; B2; B3; B4; B5];
