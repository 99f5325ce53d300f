function inForces
include_global

S1 = Force_struct;
S1.type = 'weight';
S2 = Force_struct;
S2.type = 'np';
S2.iBindex = 3;
S2.np = [0; 2; 0];             % drives the front wheel forward

Forces = [S1; S2];
