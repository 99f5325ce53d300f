function inForces
include_global

S1 = Force_struct;
S1.type = 'user';           % the contact, in user_force.m
S2 = Force_struct;
S2.type = 'weight';
S2.gravity = 9.81;
S2.wgt = [0; 0; -1];

Forces = [S1; S2];
