function inForces
include_global

S1 = Force_struct;
S1.type = 'weight';

Forces = [S1];
