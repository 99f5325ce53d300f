function inBodies
include_global

R = 0.1;                    % radius

B1 = Body_struct;
B1.mass = 1;
B1.Jp = diag([0.007 0.007 0.007]);
B1.r = [0; 0; 10*R];        % dropped from rest

Bodies = [B1];
