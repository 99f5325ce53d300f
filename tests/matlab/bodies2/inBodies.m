function inBodies
include_global
% Two bodies that hang on spring-dampers; both are released from rest.

B1 = Body_struct;
B1.mass = 1.5;
B1.Jp = 0.06*eye(3);
B1.r = [-0.5; 0; 1.5];      % both springs are unstretched at the start
B1.color = 'b';

B2 = Body_struct;
B2.mass = 2.0;
B2.Jp = [0.1  0    0
         0    0.1  0
         0    0    0.1];
B2.r = [-0.5; 1.2; 0.5];
B2.color = 'r';

Bodies = [B1; B2];
